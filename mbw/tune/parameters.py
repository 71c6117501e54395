"""Table of stiffness and damping with their intervals."""

import math
from html import escape

from identification.words import percent_text
from mbw.page.numbers import format_four_digits
from mbw.remarks import calibration_sentence, gain_tolerance
from tuning import TunedFile
from tuning.files.schema import ModeTableFile, ParameterRow

_BAR_OCTAVES = 2.0  # range of a bar on either side of the nominal value: a factor of 4
_MAX_BAR_FACTOR = 2.0**_BAR_OCTAVES
_HEAD = (
    '<th class="name">parameter</th><th>as drawn</th><th>tuned</th><th colspan="2">95 % interval'
    '</th><th class="name">unit</th><th>factor</th><th class="name">÷4 … &times;4</th>'
)


def parameters_table(summary: TunedFile | ModeTableFile) -> str:
    """Return HTML of one row for each parameter without a prior, or that a table of modes tuned.

    Those of a table begin with what it determines best, and state what it leaves of their priors.
    """
    rows = [row for row in summary.parameters if row.prior is None or row.ratio is not None]
    rows.sort(key=lambda row: row.ratio or 0.0)
    remains = ""
    if any(row.ratio is not None for row in rows):
        remains = (
            '<th>pull</th><th title="posterior over prior standard deviation">'
            "uncertainty that remains</th>"
        )
    return (
        f'<div class="scroll"><table class="parameters"><thead><tr>{_HEAD}{remains}</tr></thead>'
        f"<tbody>{''.join(map(_row, rows))}</tbody></table></div>"
    )


def interval_note(summary: TunedFile) -> str:
    """Return what the intervals presume, and that there are doubts about it."""
    text = (
        "An interval holds the true value in 95 of 100 tests if the model lacks nothing and no "
        "tolerance is larger than stated."
    )
    text += f" {calibration_sentence(gain_tolerance(summary))}"
    if summary.fit.doubts:
        text += " The doubts above speak against that: the true value may lie outside."
    return text


def _row(row: ParameterRow) -> str:
    factor = row.tuned / row.drawn if row.drawn else math.nan
    remains = ""
    if row.ratio is not None:
        remains = f"<td>{row.pull or 0.0:+.1f}</td><td>{100 * row.ratio:.0f} %</td>"
    bound = ' <span class="bad">at bound</span>' if row.at_bound else ""
    return (
        f"<tr{'' if row.seen else ' class=unseen'}>"
        f'<td class="name" title="{escape(row.location)}">{escape(row.name)}{bound}</td>'
        f"<td>{format_four_digits(row.drawn)}</td><td>{format_four_digits(row.tuned)}</td>{_interval(row)}"
        f'<td class="name">{escape(row.unit)}</td>'
        f"<td>{'' if math.isnan(factor) else f'{factor:.3g}'}</td>"
        f'<td class="name">{_bar(row, factor)}</td>{remains}</tr>'
    )


def _interval(row: ParameterRow) -> str:
    """Return two cells: both ends of the interval, and its half width relative to the value."""
    if not row.seen and row.ratio is None:
        return '<td colspan="2" class="blind">unidentifiable</td>'
    if row.low is None or row.high is None:
        return "<td></td><td></td>"
    half = (row.high - row.low) / 2
    relative = f"±{percent_text(half / abs(row.tuned))}" if row.tuned else ""
    ends = f"{format_four_digits(row.low)} … {format_four_digits(row.high)}"
    return f'<td>{ends}</td><td class="soft">{relative}</td>'


def _bar(row: ParameterRow, factor: float) -> str:
    """Return the factor as a bar from ÷4 to ×4 with its interval as a whisker.

    The bar of an unidentifiable parameter is hatched. A factor beyond the bar stands at its end.
    """
    if not row.seen:
        return '<span class="bar hatched"><b></b></span>'
    if not factor > 0:
        return ""
    end = _place(factor)
    left, width = min(end, 50.0), abs(end - 50.0)
    whisker = ""
    if row.low is not None and row.high is not None:
        low, high = sorted((_place(row.low / row.drawn), _place(row.high / row.drawn)))
        whisker = f'<u style="left:{low:.2f}%;width:{high - low:.2f}%"></u>' if high > low else ""
    beyond = ""
    if factor > _MAX_BAR_FACTOR:
        beyond = f'<em class="above">&times;{factor:.3g} ▸</em>'
    elif factor < 1 / _MAX_BAR_FACTOR:
        beyond = f'<em class="below">◂ &divide;{1 / factor:.3g}</em>'
    return (
        f'<span class="bar"><i style="left:{left:.1f}%;width:{width:.1f}%"></i><b></b>'
        f"{whisker}{beyond}</span>"
    )


def _place(factor: float) -> float:
    """Return the position of a factor in per cent of the bar's width, clipped at its ends."""
    if factor <= 0:
        return 0.0
    return max(0.0, min(100.0, 50.0 + 50.0 / _BAR_OCTAVES * math.log2(factor)))
