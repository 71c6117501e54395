"""The table of what the drawing does not know: stiffness and damping, with their intervals."""

import math
from html import escape

from mbw.page.numbers import short
from tuning import TunedFile
from tuning.files.schema import ParameterRow

_OCTAVES = 2.0  # on either side of the bars


def parameter_rows(summary: TunedFile) -> str:
    """HTML of one table row for each parameter without a prior."""
    return "".join(_row(row) for row in summary.parameters if row.prior is None)


def _row(row: ParameterRow) -> str:
    factor = row.tuned / row.drawn if row.drawn else math.nan
    bound = ' <span class="bad">at bound</span>' if row.at_bound else ""
    return (
        f"<tr{'' if row.seen else ' class=unseen'}>"
        f'<td class="name" title="{escape(row.location)}">{escape(row.name)}{bound}</td>'
        f"<td>{short(row.drawn)}</td><td>{short(row.tuned)}</td>{_interval(row)}"
        f'<td class="name">{escape(row.unit)}</td>'
        f"<td>{'' if math.isnan(factor) else f'{factor:.3g}'}</td>"
        f'<td class="name">{_bar(row, factor)}</td></tr>'
    )


def _interval(row: ParameterRow) -> str:
    """Both ends, and half their distance as the eye wants it."""
    if not row.seen:
        return '<td colspan="2" class="blind">the data do not tell</td>'
    if row.low is None or row.high is None:
        return "<td></td><td></td>"
    half = (row.high - row.low) / 2
    relative = f"±{100 * half / abs(row.tuned):.2g} %" if row.tuned else ""
    return f'<td>{short(row.low)} … {short(row.high)}</td><td class="soft">{relative}</td>'


def _bar(row: ParameterRow, factor: float) -> str:
    """The factor as a bar from ÷4 to ×4, its interval a whisker; hatched where no data tell."""
    if not row.seen:
        return '<span class="bar hatched"><b></b></span>'
    if not factor > 0:
        return ""
    end = _place(factor)
    left, width = min(end, 50.0), abs(end - 50.0)
    whisker = ""
    if row.low is not None and row.high is not None:
        low, high = sorted((_place(row.low / row.drawn), _place(row.high / row.drawn)))
        whisker = f'<u style="left:{low:.2f}%;width:{high - low:.2f}%"></u>'
    return (
        f'<span class="bar"><i style="left:{left:.1f}%;width:{width:.1f}%"></i><b></b>'
        f"{whisker}</span>"
    )


def _place(factor: float) -> float:
    """Per cent of the bar's width; the ends stand for all beyond them."""
    if factor <= 0:
        return 0.0
    return max(0.0, min(100.0, 50.0 + 50.0 / _OCTAVES * math.log2(factor)))
