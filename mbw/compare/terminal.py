"""Terminal output of ``mbw compare``: modes of the tests, and FRFs that differ most."""

import typer

from identification.words import percent_text
from mbw.compare.schema import ComparedFile, ScatterRow, ShiftRow

_MAX_LISTED_FRFS = 5


def print_result(result: ComparedFile) -> None:
    """Print the modes, and the FRFs that differ most."""
    (_print_fleet if result.kind == "fleet" else _print_pair)(result)
    for row in result.frfs[:_MAX_LISTED_FRFS]:
        typer.echo(
            f"FRF {row.output} / {row.input}: difference {row.over_noise:.3g} times the noise, "
            f"{percent_text(row.relative)} of the FRF"
        )


def _print_pair(result: ComparedFile) -> None:
    """Print frequency and damping of both tests, the second less the first in its deviations."""
    typer.echo(
        "mode  frequency/Hz      second  shift/%       sd     sigma  damping/%  second     sigma  "
        " MAC  changed"
    )
    for number, row in enumerate(result.modes, start=1):
        frequency = _shift_cells(row.frequency, row.frequency_shift)
        sigma = None if row.damping_shift is None else row.damping_shift.significance
        pairs = (("frequency", row.frequency_shift), ("damping", row.damping_shift))
        changed = [name for name, shift in pairs if shift is not None and shift.changed]
        percents = [None if value is None else 100 * value for value in row.damping]
        typer.echo(
            f"{number:4d}  {_cell(row.frequency[0], 12, '.3f')}  "
            f"{_cell(row.frequency[1], 10, '.3f')}  {frequency}  "
            f"{_cell(percents[0], 9, '.3f')}  {_cell(percents[1], 6, '.3f')}  "
            f"{_sigma_cell(sigma)}  "
            f"{_cell(row.mac[1] if row.frequency_shift else None, 4, '.2f')}  "
            f"{', '.join(changed) or '-'}"
        )


def _shift_cells(values: list[float | None], shift: ShiftRow | None) -> str:
    """Return a shift and its deviation relative to the first value, and their ratio."""
    first = values[0]
    if shift is None or not first:
        return f"{'-':>7}  {'-':>7}  {_sigma_cell(None)}"
    share = 100 / abs(first)
    return (
        f"{share * shift.value:+7.3f}  {share * shift.sd:7.4f}  {_sigma_cell(shift.significance)}"
    )


def _sigma_cell(value: float | None) -> str:
    """Return a shift over its deviation, in the eight characters of 1.23e+04."""
    return _cell(value, 8, ".3g")


def _print_fleet(result: ComparedFile) -> None:
    """Print mean, spread between tests and deviation within a test of each mode."""
    typer.echo(
        "mode   found   mean/Hz  spread/%  within/%  damping/%  spread/%  within/%  stands out"
    )
    for number, row in enumerate(result.modes, start=1):
        count = f"{sum(value is not None for value in row.frequency)}/{len(result.campaigns)}"
        scatters = [each for each in (row.frequency_scatter, row.damping_scatter) if each]
        names = list(dict.fromkeys(name for each in scatters for name in each.stands_out))
        cells = [
            _scatter_cells(each, *unit)
            for each, unit in zip(scatters, ((1.0, 8), (100.0, 9)), strict=True)
        ]
        typer.echo(f"{number:4d}  {count:>6}  {'  '.join(cells)}  {', '.join(names) or '-'}")


def _scatter_cells(scatter: ScatterRow, unit: float, width: int) -> str:
    """Return mean, spread and deviation within a test, both relative to the mean."""
    share = 100 / abs(scatter.mean) if scatter.mean else 0.0
    spread = None if scatter.spread is None else share * scatter.spread
    return (
        f"{unit * scatter.mean:{width}.3f}  {_cell(spread, 8, '.3g')}  "
        f"{_cell(share * scatter.within, 8, '.3g')}"
    )


def _cell(value: float | None, width: int, style: str) -> str:
    """Return a number in a column, or a dash."""
    return f"{'-' if value is None else format(value, style):>{width}}"
