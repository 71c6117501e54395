"""Table of measured modes and their partners in the nominal and in the tuned model."""

from collections.abc import Sequence
from html import escape

from tuning import TunedFile
from tuning.files.schema import ModePairRow, ModePartnerRow

_PARTNER = ("f / Hz", "damping / %", "MAC", "moves most")
_MOTION_COLUMNS = (3, 10)
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
    """Return HTML of one row for each measured mode, with differences in brackets."""
    lines = [
        "".join(
            f"<td class=name>{escape(cell)}</td>"
            if is_name
            else f"<td>{escape(cell).replace(' (', '&nbsp;(').replace(' %)', '&nbsp;%)')}</td>"
            for cell, is_name in row
        )
        for row in _rows(pairs)
    ]
    head = lines[0].replace("td", "th")
    body = "".join(f"<tr>{line}</tr>" for line in lines[1:])
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def pair_lines(pairs: Sequence[ModePairRow]) -> list[str]:
    """Return that table as lines of the terminal."""
    rows = _rows(pairs)
    widths = [max(len(cell) for cell, _ in column) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if is_name else cell.rjust(width)
            for (cell, is_name), width in zip(row, widths, strict=True)
        ).rstrip()
        for row in rows
    ]


def _rows(pairs: Sequence[ModePairRow]) -> list[list[tuple[str, bool]]]:
    """Return titles and rows of cells, each with whether it holds a name.

    Columns without any value are left out: a table of modes has no MAC, and other modes name no
    motion.
    """
    source = "measured" if any(row.line is None for row in pairs) else "table"
    titles = ["mode", f"{source}: {_PARTNER[0]}", _PARTNER[1], _PARTNER[3]]
    titles += [f"as drawn: {_PARTNER[0]}", *_PARTNER[1:3], f"tuned: {_PARTNER[0]}", *_PARTNER[1:]]
    rows = [_cells(number, row) for number, row in enumerate(pairs, start=1)]
    columns = [k for k in range(len(titles)) if any(row[k] for row in rows)]
    return [[(row[k], k in _MOTION_COLUMNS) for k in columns] for row in (titles, *rows)]


def _cells(number: int, row: ModePairRow) -> list[str]:
    damping = "" if row.damping is None else f"{100 * row.damping:.2f}"
    measured = [str(number), f"{row.frequency:.2f}", damping, row.motion or ""]
    return measured + _partner_cells(row, row.as_drawn)[:3] + _partner_cells(row, row.tuned)


def _partner_cells(row: ModePairRow, partner: ModePartnerRow | None) -> list[str]:
    if partner is None:
        return ["none", "", "", ""]
    change = partner.damping_error
    moves = partner.largest or ""
    if partner.moves_most is not None:
        moves = row.motion or "" if partner.moves_most else f"{moves}, not {row.motion}"
    return [
        f"{partner.frequency:.2f} ({100 * partner.frequency_error:+.2g} %)",
        f"{100 * partner.damping:.2f}" + ("" if change is None else f" ({100 * change:+.0f} %)"),
        "" if partner.mac is None else f"{partner.mac:.3f}",
        moves,
    ]
