"""Page of ``mbw tune --modes`` as one self-contained HTML file."""

from html import escape

from identification.words import percent_text
from mbw.page.html import badge, fill_template, warning_boxes
from mbw.page.numbers import format_four_digits
from mbw.remarks import describe_not_in_mjcf
from mbw.tune.mode_table_text import describe_motion
from tuning.files.mode_table_result import MODE_TABLE_JSON
from tuning.files.mode_table_schema import (
    ModeTableFile,
    TableParameterRow,
    TablePartnerRow,
    TabulatedModeRow,
)

MODE_TABLE_PAGE = "mode_table.html"


def render(summary: ModeTableFile) -> str:
    """Return the HTML page of a tuning to a table of modes."""
    fit = summary.fit
    return fill_template(
        "tune/mode_table.html",
        _data(summary),
        title=escape(f"{summary.model}: model and table of modes"),
        subtitle=escape(
            f"table {summary.table}, {len(summary.modes)} modes, "
            f"{len(summary.parameters)} parameters"
        ),
        lead=escape(_lead(summary)),
        badges=f'<p class="badges">{_badge(summary)}</p>',
        warnings=warning_boxes(summary.remarks),
        modes="".join(_mode(number, row) for number, row in enumerate(summary.modes, start=1)),
        parameters="".join(
            _parameter(row) for row in sorted(summary.parameters, key=lambda row: row.ratio)
        ),
        provenance=escape(
            f"{fit.outcome.capitalize()} after {fit.evaluations} evaluations"
            + (f", {fit.agreeing_starts} of {fit.starts} starts" if fit.starts > 1 else "")
            + " at this minimum. "
            + describe_not_in_mjcf(summary.not_held_by_mjcf, None, MODE_TABLE_JSON)
        ),
        scripts=["tune/mode_table.js"],
        styles=["tune/style.css"],
    )


def _lead(summary: ModeTableFile) -> str:
    errors = [
        max((abs(row.frequency_error) for row in partners if row is not None), default=None)
        for partners in (
            [row.as_drawn for row in summary.modes],
            [row.tuned for row in summary.modes],
        )
    ]
    if errors[0] is None or errors[1] is None:
        return "No row of the table has a mode of the model."
    return (
        f"As drawn, the nominal model is off by up to {percent_text(errors[0])} in frequency; "
        f"tuned, by up to {percent_text(errors[1])}. The table determines "
        f"{len(summary.determined)} of {len(summary.parameters)} parameters; the "
        "others stay near the nominal model."
    )


def _badge(summary: ModeTableFile) -> str:
    if summary.fit.converged:
        return badge("converged", good=True)
    return badge("not converged", good=False) + " " + escape(summary.fit.advice)


def _mode(number: int, row: TabulatedModeRow) -> str:
    damping = "" if row.damping is None else f"{100 * row.damping:.2f}"
    moves = "" if row.tuned is None else escape(describe_motion(row, row.tuned))
    return (
        f'<tr><td>{number}</td><td>{row.frequency:.2f}</td><td>{damping}</td><td class="name">'
        f"{escape(row.motion or '')}</td>{_partner(row.as_drawn)}{_partner(row.tuned)}"
        f'<td class="name">{moves}</td></tr>'
    )


def _partner(partner: TablePartnerRow | None) -> str:
    if partner is None:
        return '<td colspan="3" class="blind">none</td>'
    return (
        f"<td>{partner.frequency:.2f}</td><td>{100 * partner.frequency_error:+.2f}</td>"
        f"<td>{100 * partner.damping:.2f}</td>"
    )


def _parameter(row: TableParameterRow) -> str:
    low, high = (format_four_digits(value) for value in (row.low or 0.0, row.high or 0.0))
    factor = f"{row.tuned / row.drawn:.3g}" if row.drawn else ""
    return (
        f"<tr{'' if row.seen else ' class=unseen'}>"
        f'<td class="name">{escape(row.name)}</td><td>{format_four_digits(row.drawn)}</td>'
        f"<td>{format_four_digits(row.tuned)}</td><td>{low} … {high}</td>"
        f'<td class="name">{escape(row.unit)}</td><td>{factor}</td><td>{row.pull or 0.0:+.1f}</td>'
        f"<td>{100 * row.ratio:.0f} %</td></tr>"
    )


def _data(summary: ModeTableFile) -> dict[str, object]:
    def points(rows: list[TablePartnerRow | None]) -> dict[str, object]:
        kept = [row for row in rows if row is not None]
        return {
            "freq": [row.frequency for row in kept],
            "damping": [100 * row.damping for row in kept],
            "moves": [row.largest for row in kept],
        }

    damped = [row for row in summary.modes if row.damping is not None]
    return {
        "table": {
            "freq": [row.frequency for row in damped],
            "freq_sd": [row.frequency_sd for row in damped],
            "damping": [100 * (row.damping or 0.0) for row in damped],
            "damping_sd": [100 * (row.damping_sd or 0.0) for row in damped],
            "moves": [row.motion or "" for row in damped],
        },
        "drawn": points([row.as_drawn for row in summary.modes]),
        "tuned": points([row.tuned for row in summary.modes]),
    }
