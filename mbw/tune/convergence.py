"""Whether a tuning converged, whether it is to be trusted, and what its data cannot tell."""

from html import escape

from mbw.page.html import badge
from tuning import TunedFile
from tuning.files.schema import StartRow

_MOST = 10


def badges(summary: TunedFile) -> str:
    """HTML of two badges, converged and to be trusted, and of the doubts."""
    fit = summary.fit
    doubts = list(fit.doubts)
    if not fit.converged and not summary.interrupted:
        doubts.insert(0, f"the search ended early ({fit.outcome}): {fit.advice}")
    found = badge("converged" if fit.converged else "not converged", fit.converged)
    if fit.trusted or doubts:
        found += badge("to be trusted" if fit.trusted else "not to be trusted", fit.trusted)
    if not doubts:
        return f'<p class="badges">{found}</p>'
    listed = "".join(f"<li>{escape(text)}</li>" for text in doubts)
    return f'<p class="badges">{found}</p><ul class="doubts">{listed}</ul>'


def unknown_section(summary: TunedFile) -> str:
    """HTML of what the data cannot see or tell apart; empty if the tuning was interrupted."""
    if all(row.low is None for row in summary.parameters if row.seen):
        return ""
    if summary.unseen:
        listed = "".join(f"<li>{escape(row.sentence)}</li>" for row in summary.unseen)
        unseen = f'<b>Not seen</b><ul class="plain">{listed}</ul>'
    else:
        unseen = "<b>Not seen</b><p>Nothing: the data see all stiffness and damping.</p>"
    return (
        '<h2>What the data cannot tell</h2><div class="pair">'
        f"<div>{unseen}</div><div>{_correlations(summary)}</div></div>"
    )


def _correlations(summary: TunedFile) -> str:
    if not summary.correlations:
        return "<b>Told apart badly</b><p>Nothing: no correlation is above 0.9.</p>"
    rows = "".join(
        f'<tr><td class="name">{escape(row.first)}</td><td class="name">{escape(row.second)}</td>'
        f"<td>{row.correlation:+.4f}</td></tr>"
        for row in summary.correlations[:_MOST]
    )
    return (
        '<table class="tight"><thead><tr><th class="name" colspan="2">told apart badly</th>'
        f"<th>correlation</th></tr></thead><tbody>{rows}</tbody></table>"
    )


def starts_section(summary: TunedFile) -> str:
    """HTML of where several starts ended; empty for one."""
    ends = summary.fit.ends
    if len(ends) < 2:
        return ""
    best = min((row.cost for row in ends if row.cost is not None), default=None)
    rows = "".join(_start(number, row, best) for number, row in enumerate(ends, start=1))
    return (
        '<h2>Starts</h2><table><thead><tr><th class="name">start</th><th>cost</th>'
        "<th>above the best</th>"
        '<th class="name">agrees</th><th class="name">farthest from the best</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )


def _start(number: int, row: StartRow, best: float | None) -> str:
    cost = "" if row.cost is None else f"{row.cost:.6g}"
    above = "" if row.cost is None or not best else f"{100 * (row.cost / best - 1):.2f} %"
    far = ", ".join(f"{escape(name)} &times;{factor:.3g}" for name, factor in row.farthest.items())
    agrees = "yes" if row.agrees else '<span class="bad">no</span>'
    name = f"{number}, the drawing" if number == 1 else str(number)
    return (
        f'<tr><td class="name">{name}</td><td>{cost}</td><td>{above}</td>'
        f'<td class="name">{agrees}</td><td class="name">{far}</td></tr>'
    )
