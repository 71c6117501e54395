"""Lines of the terminal: rows of a table of modes beside their modes of the model."""

from tuning.files.mode_table_schema import ModeTableFile, TablePartnerRow, TabulatedModeRow

_TITLES = (
    "mode",
    "table: Hz",
    "%",
    "moves most",
    "drawn: Hz",
    "%",
    "tuned: Hz",
    "%",
    "moves most",
)
_LEFT_ALIGNED_COLUMNS = (3, 8)


def mode_lines(summary: ModeTableFile) -> list[str]:
    """Return one line for each row: the table, the model as drawn, and the tuned model."""
    rows = [
        _TITLES,
        *(_cells(number, row) for number, row in enumerate(summary.modes, start=1)),
    ]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_TITLES))]
    return [
        "  ".join(
            cell.ljust(width) if k in _LEFT_ALIGNED_COLUMNS else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _cells(number: int, row: TabulatedModeRow) -> tuple[str, ...]:
    damping = "" if row.damping is None else f"{100 * row.damping:.2f}"
    table = (str(number), f"{row.frequency:.2f}", damping, row.motion or "")
    tuned = row.tuned
    moves = "" if tuned is None else describe_motion(row, tuned)
    return (*table, *_numbers(row.as_drawn), *_numbers(tuned), moves)


def _numbers(partner: TablePartnerRow | None) -> tuple[str, str]:
    if partner is None:
        return "none", ""
    return f"{partner.frequency:.2f}", f"{100 * partner.damping:.2f}"


def describe_motion(row: TabulatedModeRow, partner: TablePartnerRow) -> str:
    """Return the motion that the row names if it is the largest, else the largest one."""
    if partner.moves_most:
        return row.motion or ""
    if partner.moves_most is False:
        return f"{partner.largest}, not {row.motion}"
    return partner.largest
