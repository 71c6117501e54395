"""Page of ``mbw tune --modes``: the page of a tuning, with a chart of modes in place of FRFs."""

from html import escape

from identification.words import percent_text
from mbw.page.html import badge, fill_template, warning_boxes
from mbw.tune.convergence import provenance
from mbw.tune.mode_pairs import pairs_table
from mbw.tune.parameters import parameters_table
from tuning.files.schema import ModeTableFile

MODE_TABLE_PAGE = "mode_table.html"
_CHART = (
    '<div id="modes" class="plot"></div><p class="soft">Bars of the table: one standard deviation '
    "of the fit. <em>As drawn</em>: the nominal model, with all parameters as in the MJCF.</p>"
)
_INTERVALS = (
    "A pull is the shift of a parameter in units of its prior's standard deviation. Where all of "
    "the prior's uncertainty remains, the table tells nothing about the parameter, and it stays "
    "near the nominal model."
)


def render(summary: ModeTableFile) -> str:
    """Return the HTML page of a tuning to a table of modes."""
    fit = summary.fit
    end = badge("converged", good=True)
    if not fit.converged:
        end = f"{badge('not converged', good=False)} {escape(fit.advice)}"
    return fill_template(
        "tune/template.html",
        {"modes": [row.model_dump() for row in summary.modes]},
        title=escape(f"{summary.model}: model and table of modes"),
        subtitle=escape(
            f"table {summary.table}, {len(summary.modes)} modes, "
            f"{len(summary.parameters)} parameters"
        ),
        lead=escape(_lead(summary)),
        badges=f'<p class="badges">{end}</p>',
        warnings=warning_boxes(summary.remarks),
        charts=_CHART,
        parameters=parameters_table(summary),
        intervals=_INTERVALS,
        modes=f"<h2>Table and modes of the model</h2>{pairs_table(summary.modes)}",
        provenance=provenance(summary),
        scripts=["tune/mode_table.js"],
        styles=["tune/style.css"],
        **dict.fromkeys(("pulls", "unknown", "starts", "tests"), ""),
    )


def _lead(summary: ModeTableFile) -> str:
    drawn = [abs(row.as_drawn.frequency_error) for row in summary.modes if row.as_drawn]
    tuned = [abs(row.tuned.frequency_error) for row in summary.modes if row.tuned]
    if not (drawn and tuned):
        return "No row of the table has a mode of the model."
    return (
        f"As drawn, the nominal model is off by up to {percent_text(max(drawn))} in frequency; "
        f"tuned, by up to {percent_text(max(tuned))}. The table determines "
        f"{len(summary.determined)} of {len(summary.parameters)} parameters; the "
        "others stay near the nominal model."
    )
