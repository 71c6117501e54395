"""Output files of a tuning to a table of modes: mode_table.json, mode_table.csv, tuned MJCF."""

import hashlib
import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.readers.mode_table import TabulatedMode
from identification.readers.result_files import read_result_json
from identification.words.csv_cells import write_csv
from mbmodel import NOT_WRITTEN, WrittenModel, mjcf_files, write_model
from tuning.assessment.parameter_confidence import NORMAL_QUANTILE_95
from tuning.files.mode_table_schema import (
    ModeTableFile,
    TableFitRow,
    TableParameterRow,
    TablePartnerRow,
    TabulatedModeRow,
)
from tuning.files.posterior_file import POSTERIOR_NPZ, machine_posterior, write_posterior
from tuning.files.result import TUNED_MJCF, final_folder
from tuning.files.schema import InputRow, ModelModeRow
from tuning.mode_table.mode_table_misfit import MAX_FREQUENCY_RATIO, TableMatch, relative_deviations
from tuning.mode_table.mode_table_tuning import (
    AGREEMENT_FACTOR,
    DETERMINED_RATIO,
    ModeTableTuning,
)

MODE_TABLE_JSON, MODE_TABLE_CSV = "mode_table.json", "mode_table.csv"
REACHED_SD, MISSED_SD = 1.0, 3.0  # of a row: reached within the first, missed beyond the second


def summarise_mode_table(
    tuned: ModeTableTuning, written: WrittenModel = NOT_WRITTEN
) -> ModeTableFile:
    """Return the content of mode_table.json.

    Args:
        tuned: the tuning.
        written: what became of the tuned MJCF.
    """
    minimum, parameters = tuned.minimum, _parameter_rows(tuned)
    rows = [
        _mode_row(mode, k, tuned.before, tuned.after) for k, mode in enumerate(tuned.table.modes)
    ]
    without_row = _modes_without_row(tuned)
    return ModeTableFile(
        table=tuned.table.source.name,
        model=tuned.model.machine.name,
        fit=TableFitRow(
            outcome=minimum.outcome,
            converged=minimum.outcome == "converged",
            advice=minimum.advice,
            evaluations=minimum.evaluations,
            cost=minimum.value,
            chi_square=tuned.chi_square,
            starts=len(tuned.costs),
            agreeing_starts=sum(cost <= AGREEMENT_FACTOR * minimum.value for cost in tuned.costs),
        ),
        modes=rows,
        modes_without_row=without_row,
        parameters=parameters,
        determined=[row.name for row in parameters if row.ratio < DETERMINED_RATIO],
        remarks=[*tuned.table.remarks, *_remarks(rows, without_row)],
        not_held_by_mjcf=[str(missing) for missing in written.not_held],
        mjcf_difference=written.difference,
        inputs=_input_rows(tuned),
    )


def _parameter_rows(tuned: ModeTableTuning) -> list[TableParameterRow]:
    """Return one row for each parameter that varied."""
    parametrisation, x = tuned.parametrisation, tuned.minimum.x
    spread = NORMAL_QUANTILE_95 * tuned.posterior_ratio
    ends = np.sort([parametrisation.theta(x - spread), parametrisation.theta(x + spread)], axis=0)
    theta = tuned.theta
    rows = []
    for k, parameter in enumerate(tuned.model.parameters):
        coordinate = int(parametrisation.coordinate_of[k])
        if coordinate < 0:
            continue
        ratio, scale = float(tuned.posterior_ratio[coordinate]), float(parametrisation.scale[k])
        rows.append(
            TableParameterRow(
                name=parameter.name,
                location=tuned.model.locations[k],
                unit=parameter.unit,
                drawn=parameter.drawn,
                tuned=float(theta[k]),
                at_bound=False,
                low=float(ends[0, k]),
                high=float(ends[1, k]),
                deviation=ratio * scale,
                prior=scale,
                pull=float(x[coordinate]),
                seen=ratio < DETERMINED_RATIO,
                ratio=ratio,
            )
        )
    return rows


def _mode_row(
    mode: TabulatedMode, row: int, before: TableMatch, after: TableMatch
) -> TabulatedModeRow:
    freq_sd, damping_sd = relative_deviations(mode)
    return TabulatedModeRow(
        line=mode.line,
        frequency=mode.freq_hz,
        frequency_sd=freq_sd * mode.freq_hz,
        damping=mode.damping,
        damping_sd=None if mode.damping is None else damping_sd * mode.damping,
        motion=mode.motion or None,
        as_drawn=_partner(mode, row, before),
        tuned=_partner(mode, row, after),
    )


def _partner(mode: TabulatedMode, row: int, match: TableMatch) -> TablePartnerRow | None:
    partner = int(match.partner[row])
    if partner < 0:
        return None
    frequency, damping = float(match.freq_hz[partner]), float(match.damping[partner])
    return TablePartnerRow(
        mode=partner + 1,
        frequency=frequency,
        damping=damping,
        frequency_error=frequency / mode.freq_hz - 1,
        damping_error=None if mode.damping is None else damping / mode.damping - 1,
        largest=match.largest[partner],
        moves_most=bool(match.moves_most[row]) if mode.body else None,
    )


def _modes_without_row(tuned: ModeTableTuning) -> list[ModelModeRow]:
    """Return modes of the tuned model inside the table's range that are matched with no row."""
    after, frequencies = tuned.after, [mode.freq_hz for mode in tuned.table.modes]
    is_inside = (after.freq_hz >= min(frequencies)) & (after.freq_hz <= max(frequencies))
    is_inside[after.partner[after.partner >= 0]] = False
    return [
        ModelModeRow(frequency=float(after.freq_hz[k]), damping=float(after.damping[k]))
        for k in np.flatnonzero(is_inside)
    ]


def _remarks(rows: Sequence[TabulatedModeRow], without_row: Sequence[ModelModeRow]) -> list[str]:
    """Return one sentence for each row that the model does not reach."""
    sentences = []
    for number, row in enumerate(rows, start=1):
        name = f"Mode {number} ({row.frequency:.5g} Hz, row {row.line})"
        if row.tuned is None:
            sentences.append(
                f"{name} does not count: the model as drawn has no mode left for it within a "
                f"factor of {MAX_FREQUENCY_RATIO:g} in frequency."
            )
            continue
        misses = describe_misses(row, MISSED_SD)
        if misses:
            sentences.append(
                f"{name} is not reached: {', and '.join(misses)}; search from more starts with "
                "--starts, check the row, or widen a prior with --prior."
            )
    if without_row:
        listed = ", ".join(f"{mode.frequency:.4g}" for mode in without_row)
        sentences.append(
            f"Modes of the tuned model between the rows that no row names: {listed} Hz."
        )
    return sentences


def describe_misses(row: TabulatedModeRow, deviations: float) -> list[str]:
    """Return how the tuned mode of a row misses it; empty where the row is reached.

    Args:
        row: with its tuned mode.
        deviations: standard deviations of the row within which it is reached.
    """
    if row.tuned is None:
        return ["the model has no mode for it"]
    misses = []
    if abs(row.tuned.frequency - row.frequency) > deviations * row.frequency_sd:
        misses.append(
            f"the tuned mode lies at {row.tuned.frequency:.5g} Hz, "
            f"{100 * row.tuned.frequency_error:+.2g} %"
        )
    if (
        row.damping is not None
        and row.damping_sd is not None
        and abs(row.tuned.damping - row.damping) > deviations * row.damping_sd
    ):
        misses.append(
            f"its damping is {100 * row.tuned.damping:.3g} % instead of {100 * row.damping:.3g} %"
        )
    if row.tuned.moves_most is False:
        misses.append(f"{row.motion} is not its largest motion")
    return misses


def missed_rows(rows: Sequence[TabulatedModeRow], deviations: float) -> list[TabulatedModeRow]:
    """Return the rows that the tuned model does not reach within some standard deviations."""
    return [row for row in rows if describe_misses(row, deviations)]


def _input_rows(tuned: ModeTableTuning) -> list[InputRow]:
    """Return the files that were read, relative to the model's folder, with their SHA-256."""
    source = tuned.model.machine.source
    files = sorted({tuned.table.source.absolute(), *map(Path.absolute, mjcf_files(source))})
    return [
        InputRow(
            file=os.path.relpath(file, source.parent),
            sha256=hashlib.sha256(file.read_bytes()).hexdigest(),
        )
        for file in files
        if file.is_file()
    ]


def write_mode_table_result(tuned: ModeTableTuning, folder: Path) -> ModeTableFile:
    """Write the tuned MJCF, mode_table.json, .csv and posterior.npz into an existing folder.

    Args:
        tuned: the tuning.
        folder: the folder, which may be a temporary one of ``write_atomically``.

    Returns:
        The content of mode_table.json.
    """
    written = write_model(tuned.model, tuned.theta, folder / TUNED_MJCF, final_folder(folder))
    summary = summarise_mode_table(tuned, written)
    (folder / MODE_TABLE_JSON).write_text(summary.model_dump_json(indent=1) + "\n", "utf-8")
    (folder / MODE_TABLE_CSV).write_text(_csv_text(summary), "utf-8")
    x, covariance = tuned.minimum.x, tuned.covariance
    posterior = machine_posterior(tuned.model, tuned.parametrisation, x, covariance)
    write_posterior(posterior, folder / POSTERIOR_NPZ)
    return summary


def _csv_text(summary: ModeTableFile) -> str:
    """Return the rows of the table beside their modes, as CSV."""
    text = io.StringIO()
    of_model = ["mode", "frequency/Hz", "damping/%", "moves most"]
    heading = [f"{which} {name}" for which in ("as drawn", "tuned") for name in of_model]
    rows: list[list[object]] = [["frequency/Hz", "damping/%", "motion", *heading]]
    for row in summary.modes:
        cells: list[object] = [row.frequency, _per_cent(row.damping), row.motion or ""]
        for partner in (row.as_drawn, row.tuned):
            cells += (
                [""] * len(of_model)
                if partner is None
                else [
                    partner.mode, partner.frequency, _per_cent(partner.damping), partner.largest
                ]
            )  # fmt: skip
        rows.append(cells)
    write_csv(text, rows)
    return text.getvalue()


def _per_cent(ratio: float | None) -> float | str:
    return "" if ratio is None else float(f"{100 * ratio:.12g}")


def read_mode_table_result(path: Path) -> ModeTableFile:
    """Read the result of a tuning to a table of modes.

    Args:
        path: its folder, or its mode_table.json.

    Raises:
        InputError: the file is missing, or not such a result.
    """
    folder = path.parent if path.name == MODE_TABLE_JSON else path
    return read_result_json(folder / MODE_TABLE_JSON, ModeTableFile, "mbw tune --modes")
