"""Table of measured modes and their partners in the nominal and in the tuned model."""

from tuning import TunedFile
from tuning.files.schema import ModePairRow, ModePartnerRow

_HEAD = (
    "<table><thead><tr><th>mode</th><th>frequency / Hz</th><th>damping / %</th>"
    "<th>as drawn: frequency</th><th>damping</th><th>MAC</th>"
    "<th>tuned: frequency</th><th>damping</th><th>MAC</th></tr></thead><tbody>"
)


def pairs_section(summary: TunedFile) -> str:
    """Return HTML of the pairs with relative differences; empty without any pair."""
    if not summary.pairs:
        return ""
    rows = "".join(_row(number, row) for number, row in enumerate(summary.pairs, start=1))
    text = (
        '<p class="soft">Differences are relative to the measured mode. '
        f"Fitted: {' then '.join(_NAMES[name] for name in summary.residuals)}."
    )
    if summary.unpaired_modes:
        unpaired = ", ".join(f"{row.frequency:.2f}" for row in summary.unpaired_modes)
        text += f" Modes of the tuned model without a measured mode: {unpaired} Hz."
    return (
        "<h2>Measured and modelled modes</h2>"
        f'<div class="scroll">{_HEAD}{rows}</tbody></table></div>{text}</p>'
    )


_NAMES = {"modal": "modes", "log": "FRFs"}


def _row(number: int, row: ModePairRow) -> str:
    return (
        f"<tr><td>{number}</td><td>{row.frequency:.2f}</td><td>{100 * row.damping:.2f}</td>"
        f"{_cells(row.as_drawn)}{_cells(row.tuned)}</tr>"
    )


def _cells(partner: ModePartnerRow | None) -> str:
    if partner is None:
        return '<td colspan="3">none</td>'
    damping = partner.damping_error
    return (
        f"<td>{100 * partner.frequency_error:+.2f} %</td>"
        f"<td>{'' if damping is None else f'{100 * damping:+.0f} %'}</td>"
        f"<td>{partner.mac:.3f}</td>"
    )
