"""Table of measured modes and their partners in the nominal and in the tuned model."""

from collections.abc import Sequence
from html import escape

from tuning import TunedFile
from tuning.files.schema import ModePairRow, ModePartnerRow

_PARTNER = ("f / Hz", "off by / %", "damping / %", "off by / %", "MAC", "moves most")
_TITLES = (
    *("mode", "f / Hz", "damping / %", "moves most"),
    *(f"as drawn: {_PARTNER[0]}", *_PARTNER[1:]),
    *(f"tuned: {_PARTNER[0]}", *_PARTNER[1:]),
)
_MOTION_COLUMNS = (3, 9, 15)
_TERMINAL_COLUMNS = (0, 1, 2, 3, 4, 6, 10, 12, 15)
_NAMES = {"modal": "modes", "log": "FRFs"}


def pairs_section(summary: TunedFile) -> str:
    """Return HTML of the pairs with relative differences; empty without any pair."""
    if not summary.pairs:
        return ""
    text = (
        '<p class="soft">Differences are relative to the measured mode. '
        f"Fitted: {' then '.join(_NAMES[name] for name in summary.residuals)}."
    )
    if summary.unpaired_modes:
        unpaired = ", ".join(f"{row.frequency:.2f}" for row in summary.unpaired_modes)
        text += f" Modes of the tuned model without a measured mode: {unpaired} Hz."
    return f"<h2>Measured and modelled modes</h2>{pairs_table(summary.pairs)}{text}</p>"


def pairs_table(pairs: Sequence[ModePairRow]) -> str:
    """Return HTML of one row for each measured mode; columns without any value are left out."""
    rows = [_cells(number, row) for number, row in enumerate(pairs, start=1)]
    columns = [k for k in range(len(_TITLES)) if any(row[k] for row in rows)]
    lines = [
        "".join(
            f"<{kind}{' class=name' if k in _MOTION_COLUMNS else ''}>{escape(row[k])}</{kind}>"
            for k in columns
        )
        for kind, row in [("th", _TITLES), *(("td", row) for row in rows)]
    ]
    body = "".join(f"<tr>{line}</tr>" for line in lines[1:])
    return (
        f'<div class="scroll"><table><thead><tr>{lines[0]}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def pair_lines(pairs: Sequence[ModePairRow]) -> list[str]:
    """Return the lines of the terminal: frequencies, damping and largest motions."""
    rows = [_TITLES, *(_cells(number, row) for number, row in enumerate(pairs, start=1))]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_TITLES))]
    return [
        "  ".join(
            row[k].ljust(widths[k]) if k in _MOTION_COLUMNS else row[k].rjust(widths[k])
            for k in _TERMINAL_COLUMNS
        ).rstrip()
        for row in rows
    ]


def _cells(number: int, row: ModePairRow) -> tuple[str, ...]:
    """Return the cells of all columns; those that do not apply are empty."""
    damping = "" if row.damping is None else f"{100 * row.damping:.2f}"
    measured = (str(number), f"{row.frequency:.2f}", damping, row.motion or "")
    return (*measured, *_partner_cells(row, row.as_drawn), *_partner_cells(row, row.tuned))


def _partner_cells(row: ModePairRow, partner: ModePartnerRow | None) -> tuple[str, ...]:
    if partner is None:
        return ("none", *[""] * (len(_PARTNER) - 1))
    change = partner.damping_error
    moves = partner.largest or ""
    if partner.moves_most is not None:
        moves = row.motion or "" if partner.moves_most else f"{moves}, not {row.motion}"
    return (
        f"{partner.frequency:.2f}",
        f"{100 * partner.frequency_error:+.2f}",
        f"{100 * partner.damping:.2f}",
        "" if change is None else f"{100 * change:+.0f}",
        "" if partner.mac is None else f"{partner.mac:.3f}",
        moves,
    )
