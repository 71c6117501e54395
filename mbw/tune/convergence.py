"""Sections of the page on the search: convergence, trust, identifiability, starts, input files."""

from html import escape

from identification.words import capitalise
from mbw.page.html import badge, input_files
from mbw.remarks import describe_not_in_mjcf, describe_search
from tuning import TunedFile
from tuning.files.mode_table_result import MODE_TABLE_JSON
from tuning.files.result import TUNED_JSON
from tuning.files.schema import ModeTableFile, StartRow

_MAX_CORRELATION_ROWS = 10  # rows of the table of correlated parameters


def badges(summary: TunedFile) -> str:
    """Return HTML of a badge on the end of the search, green without doubts, and of the doubts."""
    fit = summary.fit
    doubts = list(fit.doubts)
    if not fit.converged and not summary.interrupted:
        doubts.insert(0, f"the search ended early ({fit.outcome}): {fit.advice}")
    if not fit.converged:
        pills = badge("not converged", good=False)
    else:
        pills = badge("converged", good=True if fit.trusted else None)
    if not doubts:
        next_step = "Next: mbw diagnose seeks what the model lacks." if fit.trusted else ""
        return f'<p class="badges">{pills} {next_step}</p>'
    pills += badge("1 doubt" if len(doubts) == 1 else f"{len(doubts)} doubts", good=False)
    listed = "".join(f"<li>{escape(text)}</li>" for text in doubts)
    return f'<p class="badges">{pills}</p><ul class="doubts">{listed}</ul>'


def identifiability_section(summary: TunedFile) -> str:
    """Return HTML of unidentifiable and of correlated parameters; empty after an interruption."""
    if all(row.low is None for row in summary.parameters if row.seen):
        return ""
    if summary.unseen:
        listed = "".join(f"<li>{escape(row.sentence)}</li>" for row in summary.unseen)
        unidentifiable = f'<b>Unidentifiable</b><ul class="plain">{listed}</ul>'
    else:
        unidentifiable = (
            "<b>Unidentifiable</b><p>None: the data determine all stiffness and damping.</p>"
        )
    return (
        '<h2>Identifiability</h2><div class="pair">'
        f"<div>{unidentifiable}</div><div>{_correlations(summary)}</div></div>"
    )


def _correlations(summary: TunedFile) -> str:
    if not summary.correlations:
        return "<b>Correlated pairs</b><p>None: no correlation is above 0.9.</p>"
    rows = "".join(
        f'<tr><td class="name">{escape(row.first)}</td><td class="name">{escape(row.second)}</td>'
        f"<td>{row.correlation:+.4f}</td></tr>"
        for row in summary.correlations[:_MAX_CORRELATION_ROWS]
    )
    return (
        '<table class="tight"><thead><tr><th class="name" colspan="2">correlated parameters</th>'
        f"<th>correlation</th></tr></thead><tbody>{rows}</tbody></table>"
    )


def starts_section(summary: TunedFile) -> str:
    """Return HTML of the final costs of several starts; empty for one start."""
    ends = summary.fit.ends
    if len(ends) < 2:
        return ""
    best = min((row.cost for row in ends if row.cost is not None), default=None)
    rows = "".join(_start(number, row, best) for number, row in enumerate(ends, start=1))
    return (
        '<h2>Random starts</h2><table><thead><tr><th class="name">start</th><th>cost</th>'
        "<th>above the best</th>"
        '<th class="name">agrees</th><th class="name">parameters that differ most</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )


def _start(number: int, row: StartRow, best: float | None) -> str:
    cost = "" if row.cost is None else f"{row.cost:.6g}"
    above = "" if row.cost is None or not best else f"{100 * (row.cost / best - 1):.2f} %"
    far = ", ".join(f"{escape(name)} &times;{factor:.3g}" for name, factor in row.farthest.items())
    agrees = "yes" if row.agrees else '<span class="bad">no</span>'
    name = f"{number}, nominal model" if number == 1 else str(number)
    return (
        f'<tr><td class="name">{name}</td><td>{cost}</td><td>{above}</td>'
        f'<td class="name">{agrees}</td><td class="name">{far}</td></tr>'
    )


def provenance(
    summary: TunedFile | ModeTableFile, sentence: str = "", not_held_error: float | None = None
) -> str:
    """Return HTML of how the search ended, what the tuned MJCF lacks, and which files were read.

    Args:
        summary: the tuning.
        sentence: further sentence on the fit.
        not_held_error: change of the FRFs without what the MJCF lacks; None if it is not known.
    """
    list_file = TUNED_JSON if isinstance(summary, TunedFile) else MODE_TABLE_JSON
    missing = describe_not_in_mjcf(summary.not_held_by_mjcf, not_held_error, list_file)
    search = describe_search(summary.fit)
    text = escape(" ".join(filter(None, [f"{capitalise(search)}.", sentence, missing])))
    return "<br>".join(filter(None, [text, input_files(summary.inputs)]))
