"""Output files of a tuning to a table of modes: mode_table.json, mode_table.csv, tuned MJCF."""

import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from identification.readers.mode_table import TabulatedMode
from identification.readers.result_files import json_text, read_result_json
from identification.words.csv_cells import write_csv
from mbmodel import NOT_WRITTEN, WrittenModel, mjcf_files, write_model
from tuning.files.input_files import hash_files
from tuning.files.mode_pair_rows import partner_row
from tuning.files.parameter_rows import parameter_rows, search_fields
from tuning.files.posterior_file import POSTERIOR_NPZ, machine_posterior, write_posterior
from tuning.files.result import TUNED_MJCF, final_folder
from tuning.files.schema import (
    FitRow,
    ModelModeRow,
    ModePairRow,
    ModePartnerRow,
    ModeTableFile,
    ParameterRow,
)
from tuning.misfit.mode_table_misfit import MAX_FREQUENCY_RATIO, TableMatch, relative_deviations
from tuning.mode_table_tuning import ModeTableTuning

MODE_TABLE_JSON, MODE_TABLE_CSV = "mode_table.json", "mode_table.csv"
REACHED_SD, MISSED_SD = 1.0, 3.0  # of a row: reached within the first, missed beyond the second


def summarise_mode_table(
    tuned: ModeTableTuning, written: WrittenModel = NOT_WRITTEN
) -> ModeTableFile:
    """Return the content of mode_table.json."""
    model, table, parameters = tuned.model, tuned.table, _parameter_rows(tuned)
    rows = [_pair_row(mode, k, tuned.before, tuned.after) for k, mode in enumerate(table.modes)]
    without_row, source = _modes_without_row(tuned), model.machine.source
    files = {table.source.absolute(), *map(Path.absolute, mjcf_files(source))}
    return ModeTableFile(
        table=table.source.name,
        model=model.machine.name,
        fit=FitRow(**search_fields(tuned.fit, tuned.confidence)),
        modes=rows,
        modes_without_row=without_row,
        parameters=parameters,
        determined=[row.name for row in parameters if row.seen],
        remarks=[*table.remarks, *_remarks(rows, without_row)],
        not_held_by_mjcf=[str(missing) for missing in written.not_held],
        mjcf_difference=written.difference,
        inputs=hash_files(sorted(files), source.parent),
    )


def _parameter_rows(tuned: ModeTableTuning) -> list[ParameterRow]:
    """Return one row for each parameter that varied, with its posterior over its prior."""
    fit, confidence = tuned.fit, tuned.confidence
    ratios = confidence.deviation[fit.parametrisation.coordinate_of[fit.parametrisation.free]]
    rows = parameter_rows(tuned.model, fit, confidence, bounded=fit, unbounded=fit)
    return [
        row.model_copy(update={"ratio": float(ratio)})
        for row, ratio in zip(rows, ratios, strict=True)
    ]


def _pair_row(mode: TabulatedMode, row: int, before: TableMatch, after: TableMatch) -> ModePairRow:
    freq_sd, damping_sd = relative_deviations(mode)

    def partner(match: TableMatch) -> ModePartnerRow | None:
        k = int(match.partner[row])
        if k < 0:
            return None
        what_moves = {"largest": match.largest(k), "moves_most": match.moves_most(row)}
        return partner_row(match, k, (mode.freq_hz, mode.damping), mode=k + 1, **what_moves)

    return ModePairRow(
        line=mode.line,
        frequency=mode.freq_hz,
        frequency_sd=freq_sd * mode.freq_hz,
        damping=mode.damping,
        damping_sd=None if mode.damping is None else damping_sd * mode.damping,
        motion=mode.motion or None,
        as_drawn=partner(before),
        tuned=partner(after),
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


def _remarks(rows: Sequence[ModePairRow], without_row: Sequence[ModelModeRow]) -> Iterator[str]:
    """Yield one sentence for each row that the model does not reach, and for modes in excess."""
    for number, row in enumerate(rows, start=1):
        name = f"Mode {number} ({row.frequency:.5g} Hz, row {row.line})"
        if row.tuned is None:
            yield (
                f"{name} does not count: the model as drawn has no mode left for it within a "
                f"factor of {MAX_FREQUENCY_RATIO:g} in frequency."
            )
        elif misses := describe_misses(row, MISSED_SD):
            yield (
                f"{name} is not reached: {', and '.join(misses)}; search from more starts with "
                "--starts, check the row, or widen a prior with --prior."
            )
    if without_row:
        listed = ", ".join(f"{mode.frequency:.4g}" for mode in without_row)
        yield f"Modes of the tuned model between the rows that no row names: {listed} Hz."


def describe_misses(row: ModePairRow, deviations: float) -> list[str]:
    """Return how the tuned mode of a row misses it; empty where the row is reached.

    Args:
        row: row with its tuned mode.
        deviations: standard deviations of the row within which it is reached.
    """
    tuned, misses = row.tuned, []
    if tuned is None:
        return ["the model has no mode for it"]
    if abs(tuned.frequency - row.frequency) > deviations * row.frequency_sd:
        misses.append(
            f"the tuned mode lies at {tuned.frequency:.5g} Hz, {100 * tuned.frequency_error:+.2g} %"
        )
    damping, limit = row.damping, deviations * (row.damping_sd or 0.0)
    if damping is not None and abs(tuned.damping - damping) > limit:
        misses.append(
            f"its damping is {100 * tuned.damping:.3g} % instead of {100 * damping:.3g} %"
        )
    if tuned.moves_most is False:
        misses.append(f"{row.motion} is not its largest motion")
    return misses


def missed_rows(rows: Sequence[ModePairRow], deviations: float) -> list[ModePairRow]:
    """Return the rows that the tuned model does not reach within some standard deviations."""
    return [row for row in rows if describe_misses(row, deviations)]


def write_mode_table_result(tuned: ModeTableTuning, folder: Path) -> ModeTableFile:
    """Write the tuned MJCF, mode_table.json, .csv and posterior.npz into an existing folder.

    Args:
        folder: the folder, which may be a temporary one of ``write_atomically``.

    Returns:
        The content of mode_table.json.
    """
    fit = tuned.fit
    written = write_model(tuned.model, fit.theta, folder / TUNED_MJCF, final_folder(folder))
    summary = summarise_mode_table(tuned, written)
    (folder / MODE_TABLE_JSON).write_text(json_text(summary) + "\n", "utf-8")
    (folder / MODE_TABLE_CSV).write_text(_csv_text(summary.modes), "utf-8")
    posterior = machine_posterior(
        tuned.model, fit.parametrisation, fit.x, tuned.confidence.covariance
    )
    write_posterior(posterior, folder / POSTERIOR_NPZ)
    return summary


def _csv_text(rows: Sequence[ModePairRow]) -> str:
    """Return the rows of the table beside their modes, as CSV."""

    def per_cent(ratio: float | None) -> float | str:
        return "" if ratio is None else float(f"{100 * ratio:.12g}")

    def cells(row: ModePartnerRow | None) -> list[object]:
        if row is None:
            return [""] * 4
        return [row.mode, row.frequency, per_cent(row.damping), row.largest]

    titles = ("mode", "frequency/Hz", "damping/%", "moves most")
    models = [f"{which} {title}" for which in ("as drawn", "tuned") for title in titles]
    lines = (
        [row.frequency, per_cent(row.damping), row.motion or "",
         *cells(row.as_drawn), *cells(row.tuned)]
        for row in rows
    )  # fmt: skip
    text = io.StringIO()
    write_csv(text, [["frequency/Hz", "damping/%", "motion", *models], *lines])
    return text.getvalue()


def read_mode_table_result(path: Path) -> ModeTableFile:
    """Read mode_table.json, or that of a folder.

    Raises:
        InputError: the file is missing, or not such a result.
    """
    file = path / MODE_TABLE_JSON if path.is_dir() else path
    return read_result_json(file, ModeTableFile, "mbw tune --modes")
