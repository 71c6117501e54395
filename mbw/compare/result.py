"""Result of ``mbw compare``: rows of its JSON and CSV files."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from diagnosis import Verdict
from diagnosis.between_visits import VISIT_PRIORS
from diagnosis.settings import SETTINGS
from diagnosis.verdict.sentences import change_sentence
from identification.comparison import (
    CellDifference,
    ComparedMode,
    FleetScatter,
    Shift,
    TestComparison,
    VisitDrift,
    compare_frfs,
    compute_scatter,
    compute_shifts,
    describe_fleet,
    describe_shifts,
)
from identification.words import Real, percent_text
from identification.words.csv_cells import write_csv
from identification.words.file_access import read_bytes
from mbw.compare.schema import (
    CampaignRow,
    ComparedFile,
    ComparedModeRow,
    Kind,
    ScatterRow,
    ShiftRow,
)
from mbw.diagnose.sentences import cause_parameters

COMPARED_JSON, PAGE, MODES_CSV, FRFS_CSV = "compared.json", "page.html", "modes.csv", "frfs.csv"
NAMES = COMPARED_JSON, PAGE, MODES_CSV, FRFS_CSV
# Noise alone gives 1, and what is mounted anew differs by a per cent.
_MIN_OVER_NOISE, _MIN_RELATIVE = 1.3, 0.05
_NUMBERS = ("frequency", "frequency_sd", "damping", "damping_sd", "mac", "probability")


def visit_drift(kind: Kind) -> VisitDrift:
    """Return what differs between two visits to one machine without a change."""
    if kind != "visits":
        return VisitDrift()
    return VisitDrift(VISIT_PRIORS.stiffness / 2, VISIT_PRIORS.damping)  # frequency as sqrt(k)


def collect_result(
    comparison: TestComparison,
    sources: Sequence[Path],
    kind: Kind,
    remarks: Sequence[str],
) -> ComparedFile:
    """Collect the result of a comparison without a diagnosis.

    Args:
        comparison: tests beside each other.
        sources: paths of their campaign.toml.
        kind: what they are of.
        remarks: sentences on the tests.
    """
    modes, names = comparison.modes, comparison.names
    rows = [_mode_row(mode) for mode in modes]
    frfs = [] if kind == "fleet" else list(compare_frfs(comparison))
    if kind == "fleet":
        sentence = _add_scatter(rows, comparison)
    else:
        shifts = compute_shifts(modes, visit_drift(kind))
        sentence = describe_shifts(modes, shifts, names, is_one_machine=kind == "visits")
        for row, shift in zip(rows, shifts, strict=True):
            if shift is not None:
                row.frequency_shift, row.damping_shift = map(_shift_row, shift)
        if not any(each.is_change for shift in shifts if shift is not None for each in shift):
            sentence = " ".join([sentence, *_tell_frfs(frfs)])
    return ComparedFile(
        kind=kind,
        campaigns=[
            CampaignRow(name=name, source=str(source))
            for name, source in zip(names, sources, strict=True)
        ],
        sentence=sentence,
        remarks=[*comparison.remarks, *remarks],
        band=comparison.band,
        channels=[str(dof) for dof in comparison.outputs],
        modes=rows,
        frfs=frfs,
    )


def _tell_frfs(rows: Sequence[CellDifference]) -> list[str]:
    """Return a sentence on FRFs that differ although no mode does; ``rows`` as compared."""
    differing = [
        row for row in rows if row.over_noise > _MIN_OVER_NOISE and row.relative > _MIN_RELATIVE
    ]
    if not differing:
        return []
    most = max(differing, key=lambda row: row.relative)
    return [
        f"{len(differing)} of {len(rows)} FRFs differ all the same, most {most.output} / "
        f"{most.input} by {percent_text(most.relative)}, {most.over_noise:.3g} times the noise."
    ]


def add_verdict(result: ComparedFile, verdict: Verdict) -> ComparedFile:
    """Return the result with the verdict on the change, and its sentence with sizes."""
    likely = (row for row in verdict.causes if row.probability >= SETTINGS.min_probability)
    sizes = [text for row in likely if (text := cause_parameters(row))]
    change = " ".join([change_sentence(verdict), *(f"Size: {text}." for text in sizes)])
    return result.model_copy(update={"verdict": verdict, "change": change})


def _add_scatter(rows: list[ComparedModeRow], comparison: TestComparison) -> str:
    """Add the scatter over a fleet to the rows of its modes; return its sentence."""
    modes, names = comparison.modes, comparison.names
    frequency, damping = (
        compute_scatter(_stack(modes, name), _stack(modes, f"{name}_sd"))
        for name in ("freq_hz", "damping")
    )
    # FleetScatter of the frequencies, with what stands out by damping.
    for k, row in enumerate(rows):
        row.frequency_scatter = _scatter_row(frequency, k, names)
        row.damping_scatter = _scatter_row(damping, k, names)
    either = FleetScatter(
        frequency.mean,
        frequency.spread,
        frequency.within,
        frequency.stands_out | damping.stands_out,
    )
    return describe_fleet(modes, either, names)


def _stack(modes: Sequence[ComparedMode], name: str) -> Real:
    """Return a number of all modes in all tests; (n_mode, n_test)."""
    rows = [getattr(mode, name.replace("freq_hz_sd", "freq_sd")) for mode in modes]
    return np.array(rows).reshape(len(rows), -1)


def _mode_row(mode: ComparedMode) -> ComparedModeRow:
    def nulls(values: Real) -> list[float | None]:
        return [None if math.isnan(value) else value for value in values.tolist()]

    return ComparedModeRow(
        frequency=nulls(mode.freq_hz),
        frequency_sd=nulls(mode.freq_sd),
        damping=nulls(mode.damping),
        damping_sd=nulls(mode.damping_sd),
        mac=nulls(mode.mac),
        probability=nulls(mode.probability),
    )


def _shift_row(shift: Shift) -> ShiftRow:
    significance = shift.significance if math.isfinite(shift.significance) else None
    return ShiftRow(
        value=shift.value, sd=shift.deviation, significance=significance, changed=shift.is_change
    )


def _scatter_row(scatter: FleetScatter, mode: int, names: Sequence[str]) -> ScatterRow:
    spread = float(scatter.spread[mode])
    return ScatterRow(
        mean=float(scatter.mean[mode]),
        spread=None if math.isnan(spread) else spread,
        within=float(scatter.within[mode]),
        stands_out=[names[k] for k in np.flatnonzero(scatter.stands_out[mode]).tolist()],
    )


def write_result(result: ComparedFile, folder: Path) -> None:
    """Write JSON and CSV files into an existing folder."""
    (folder / COMPARED_JSON).write_text(result.model_dump_json(indent=1) + "\n", "utf-8")
    with (folder / MODES_CSV).open("w", encoding="utf-8", newline="") as stream:
        write_csv(stream, _mode_lines(result))
    if result.kind != "fleet":
        rows = [(row.output, row.input, row.over_noise, row.relative) for row in result.frfs]
        with (folder / FRFS_CSV).open("w", encoding="utf-8", newline="") as stream:
            write_csv(stream, [("output", "input", "over_noise", "relative"), *rows])


def _mode_lines(result: ComparedFile) -> Iterator[list[object]]:
    """Yield the header and one line for each mode; empty cells where a number does not exist."""
    names = [row.name for row in result.campaigns]
    shift = ("value", "sd", "significance", "changed")
    scatter = ("mean", "spread", "within", "stands_out")
    of_all = scatter if result.kind == "fleet" else shift
    kind = "scatter" if result.kind == "fleet" else "shift"
    units = {"frequency": "_hz", "frequency_sd": "_hz"}
    yield [
        *(f"{number}{units.get(number, '')} {name}" for number in _NUMBERS for name in names),
        *(f"{number}_{kind}_{key}" for number in ("frequency", "damping") for key in of_all),
    ]
    for mode in result.modes:
        cells: list[object] = [value for number in _NUMBERS for value in getattr(mode, number)]
        for number in ("frequency", "damping"):
            row = getattr(mode, f"{number}_{kind}")
            cells += [None if row is None else getattr(row, key) for key in of_all]
        yield [
            "" if cell is None else " ".join(cell) if isinstance(cell, list) else cell
            for cell in cells
        ]


def read_page(path: Path) -> str:
    """Return the page in a folder that ``mbw compare`` wrote.

    Raises:
        InputError: there is none.
    """
    folder = path if path.is_dir() else path.parent
    return read_bytes(folder / PAGE, "run mbw compare again, with pictures").decode("utf-8")
