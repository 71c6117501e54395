"""Output files of a tuning: tuned.json, the tuned MJCF, and the FRFs."""

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.readers.result_files import (
    json_text,
    read_result_arrays,
    read_result_json,
    write_result_arrays,
)
from identification.words import Campaign, Complex, InputError, Real
from mbmodel import NOT_WRITTEN, Model, WrittenModel, held_parameters, model_modes, write_model
from tuning.assessment.gap import block_error_shares, relative_change
from tuning.campaign_tuning import CampaignTuning, Comparison
from tuning.control_loops.loops_file import LOOPS_JSON, write_loops
from tuning.files.input_files import input_rows
from tuning.files.mode_pair_rows import pair_rows
from tuning.files.parameter_rows import channel_gain_rows, fit_row, parameter_rows
from tuning.files.posterior_file import POSTERIOR_NPZ, machine_posterior, write_posterior
from tuning.files.schema import (
    BlockRow,
    GapRow,
    GapTable,
    LevelGap,
    ModelModeRow,
    ShareRow,
    TunedFile,
    TunedTestRow,
)
from tuning.misfit.batch import predict
from tuning.misfit.residual_statistics import estimate_model_error

TUNED_JSON, TUNED_MJCF, FRF_NPZ = "tuned.json", "tuned.xml", "frf.npz"
LEVELS = ("sensors", "bodies")
_STAGING_PREFIX = ".writing-"  # of the name of a temporary folder inside that of a result
_MAX_CORRELATIONS = 100  # that are written


@dataclass(frozen=True, eq=False)
class LevelFrfs:
    """FRFs at the sensors or at the bodies, all tests side by side.

    Args:
        outputs: label of each channel; n_channel.
        tests: label of each channel's test; n_channel.
        measured: measured FRFs; (n_freq, n_channel).
        as_drawn: FRFs of the nominal model; (n_freq, n_channel).
        tuned: FRFs of the tuned model; (n_freq, n_channel).
        noise: standard deviation of the measured FRFs; (n_freq, n_channel).
        deviation: standard deviation of the tuned model's magnitudes; None if interrupted.
        held_out: FRFs by the fits that left each line out; None if there are none.
    """

    outputs: tuple[str, ...]
    tests: tuple[str, ...]
    measured: Complex
    as_drawn: Complex
    tuned: Complex
    noise: Real
    deviation: Real | None = None
    held_out: Complex | None = None


@dataclass(frozen=True, eq=False)
class TuningResult:
    """A tuning, as read from its folder.

    Args:
        summary: content of tuned.json.
        freq_hz: lines; (n_freq,).
        levels: FRFs at the ``sensors`` and at the ``bodies``.
    """

    summary: TunedFile
    freq_hz: Real
    levels: dict[str, LevelFrfs]

    @property
    def blocks(self) -> int:
        """Number of blocks of lines that were held out."""
        return len(self.summary.held_out_blocks)


def summarise_tuning(
    tuned: CampaignTuning,
    remaining: Sequence[ShareRow] = (),
    written: WrittenModel = NOT_WRITTEN,
) -> TunedFile:
    """Return the content of tuned.json."""
    session = tuned.session
    model, campaign = session.model, session.campaign
    freq, theta = campaign.freq_hz, tuned.model_fit.theta
    modes = {"as_drawn": _mode_rows(tuned, model.drawn), "tuned": _mode_rows(tuned, theta)}
    pairs, unpaired = (
        ([], [])
        if tuned.measured_modes is None
        else pair_rows(model, tuned.measured_modes, theta, modes)
    )
    gap = GapTable(sensors=_level_gap(tuned.sensors), bodies=_level_gap(tuned.bodies))
    confidence = tuned.confidence
    return TunedFile(
        campaign=campaign.name,
        model=model.machine.name,
        quantity=campaign.tests[0].estimate.frf.quantity,
        band=(float(freq[0]), float(freq[-1])),
        lines=len(freq),
        interrupted=tuned.interrupted,
        held_out_outcomes=list(tuned.held_out.outcomes) if tuned.held_out else [],
        held_out_blocks=_block_rows(tuned),
        tests=[
            TunedTestRow(
                file=test.condition.test,
                reference=str(test.condition.reference),
                level=test.condition.level_n,
                averages=test.estimate.averages,
                variance_from=test.estimate.variance_source,
                channels=len(test.estimate.frf.outputs),
                variant=test.condition.variant,
                drive_unit=test.condition.drive_unit,
            )
            for test in campaign.tests
        ],
        fit=fit_row(tuned, gap.bodies if tuned.at == "bodies" else gap.sensors),
        gap=gap,
        model_error=_model_error(tuned.sensors),
        parameters=parameter_rows(
            model,
            tuned.model_fit,
            confidence,
            bounded=tuned.fit,
            # Modes alone say nothing about tolerances.
            unbounded=tuned.unbounded_fit if tuned.residuals[-1] == "log" else None,
        ),
        correlations=[]
        if confidence is None
        else list(confidence.correlations()[:_MAX_CORRELATIONS]),
        unseen=[] if confidence is None else list(confidence.unidentifiable_directions()),
        information=list(tuned.gains),
        channel_gains=channel_gain_rows(
            campaign.unknown_gains.nominal,
            tuned.model_fit.parametrisation,
            theta,
            None if confidence is None else confidence.interval(),
        ),
        inputs=input_rows(session),
        modes=modes,
        residuals=list(tuned.residuals),
        at=tuned.at,
        pairs=pairs,
        unpaired_modes=unpaired,
        remaining_gap=list(remaining),
        not_held_by_mjcf=[str(missing) for missing in written.not_held],
        not_held_error=not_held_error(model, theta, campaign) if written.not_held else None,
        mjcf_difference=written.difference,
    )


def _model_error(comparison: Comparison) -> float | None:
    """Return the model's relative error, on held-out lines if there are any.

    None where it is no larger than a force sensor's error, or no channel moves.
    """
    predicted = comparison.held_out or comparison.bounded
    error = estimate_model_error(predicted, comparison.campaign)
    return None if error is None or error.is_at_force_error else error.floor


def _level_gap(comparison: Comparison) -> LevelGap:
    """Return the gaps of one level."""
    drawn, tuned = comparison.gap(comparison.as_drawn), comparison.gap(comparison.bounded)
    held_out = comparison.held_out
    return LevelGap(
        as_drawn=GapRow.model_validate(drawn),
        tuned=GapRow.model_validate(tuned),
        held_out=None if held_out is None else GapRow.model_validate(comparison.gap(held_out)),
        noise=drawn.noise,
        channels=drawn.channels,
        quiet_channels=drawn.quiet,
    )


def _block_rows(tuned: CampaignTuning) -> list[BlockRow]:
    """Return the held-out blocks with their shares of the squared error."""
    sensors, held_out = tuned.sensors, tuned.held_out
    if held_out is None or sensors.held_out is None:
        return []
    freq = sensors.campaign.freq_hz
    starts = held_out.starts
    shares = block_error_shares(sensors.held_out, sensors.campaign, starts)
    return [
        BlockRow(
            low=float(freq[start]),
            high=float(freq[stop - 1]),
            share=float(share),
        )
        for start, stop, share in zip(starts, [*starts[1:], len(freq)], shares, strict=True)
    ]


def _mode_rows(tuned: CampaignTuning, theta: Real) -> list[ModelModeRow]:
    """Return the modes of the model in the band."""
    modes = model_modes(tuned.session.model, theta)
    lowest, highest = tuned.session.campaign.freq_hz[[0, -1]]
    return [
        ModelModeRow(frequency=float(frequency), damping=float(damping))
        for frequency, damping, pole in zip(modes.freq_hz, modes.damping, modes.poles, strict=True)
        if pole.imag > 0 and lowest <= frequency <= highest
    ]


def write_result(
    tuned: CampaignTuning, folder: Path, remaining: Sequence[ShareRow] = ()
) -> TunedFile:
    """Write tuned.json, tuned.xml, frf.npz, posterior.npz and loops.json, whole or not at all.

    Without intervals, after an interruption, there is no posterior.npz, and without loops that
    were closed during the test no loops.json.

    Args:
        folder: created if missing; files of these names in it are replaced.

    Returns:
        The content of tuned.json.

    Raises:
        InputError: the folder cannot be written.
    """
    model, theta = tuned.session.model, tuned.model_fit.theta
    with write_atomically(folder) as place:
        written = write_model(model, theta, place / TUNED_MJCF, final_folder(place))
        write_result_arrays(place / FRF_NPZ, _arrays(tuned))
        summary = summarise_tuning(tuned, remaining, written)
        (place / TUNED_JSON).write_text(json_text(summary) + "\n", "utf-8")
        write_loops(model.machine.loops, place / LOOPS_JSON)
        if tuned.confidence is not None and tuned.plant is not None:
            posterior = machine_posterior(
                model,
                tuned.confidence.parametrisation,
                tuned.confidence.x,
                tuned.plant.covariance,
                summary.model_error,
                tuned.plant.discrepancy,
            )
            write_posterior(posterior, place / POSTERIOR_NPZ)
    return summary


def not_held_error(model: Model, theta: Real, campaign: Campaign) -> float | None:
    """Return the relative change of the FRFs of a campaign without what an MJCF cannot hold.

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    without_rest = replace(model, machine=replace(model.machine, rest=None))
    held = predict(without_rest, held_parameters(model, theta), campaign)
    return relative_change(held, predict(model, theta, campaign))


def final_folder(place: Path) -> Path:
    """Return the folder to which the files of a temporary folder of ``write_atomically`` move."""
    while place.name.startswith(_STAGING_PREFIX):
        place = place.parent
    return place


@contextmanager
def write_atomically(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder whose files move to another folder once the block has succeeded.

    Args:
        folder: folder of the files; created if missing.

    Raises:
        InputError: the folder cannot be created or written, or a file's name is taken by a folder.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=_STAGING_PREFIX) as name:
            yield Path(name)
            files = sorted(Path(name).iterdir())
            for file in files:
                if (folder / file.name).is_dir():
                    raise InputError(
                        f"{folder / file.name} is a folder: name another output folder"
                    )
            for file in files:
                os.replace(file, folder / file.name)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be created or written ({error.strerror}): name another folder"
        ) from error


def _arrays(tuned: CampaignTuning) -> dict[str, np.ndarray]:
    """Return the arrays of frf.npz."""
    arrays: dict[str, np.ndarray] = {"freq_hz": tuned.session.campaign.freq_hz}
    for name in LEVELS:
        comparison: Comparison = getattr(tuned, name)
        tests = comparison.campaign.tests
        arrays[f"{name}_outputs"] = np.array(
            [str(dof) for test in tests for dof in test.estimate.frf.outputs]
        )
        arrays[f"{name}_tests"] = np.array(
            [
                f"{test.condition.reference} in {test.condition.test}"
                for test in tests
                for _ in test.estimate.frf.outputs
            ]
        )
        arrays[f"{name}_measured"] = _stack_tests([test.estimate.frf.values for test in tests])
        arrays[f"{name}_as_drawn"] = _stack_tests(comparison.as_drawn)
        arrays[f"{name}_tuned"] = _stack_tests(comparison.tuned)
        if comparison.deviation is not None:
            arrays[f"{name}_deviation"] = _stack_tests(comparison.deviation).real.astype(np.float32)
        if comparison.held_out is not None:
            arrays[f"{name}_held_out"] = _stack_tests(comparison.held_out)
        noise = [np.sqrt(test.estimate.variance[:, :, 0]) for test in tests]
        arrays[f"{name}_noise"] = np.hstack(noise).astype(np.float32)
    return arrays


def _stack_tests(values: "Sequence[Complex] | Sequence[Real]") -> np.ndarray:
    """Stack the tests' FRFs side by side; (n_freq, n_channel)."""
    return np.hstack([value[:, :, 0] for value in values]).astype(np.complex64)


def read_result(path: Path) -> TuningResult:
    """Read the result of a tuning.

    Args:
        path: its folder, or its tuned.json.

    Raises:
        InputError: files that are missing or not of a tuning.
    """
    folder = path.parent if path.name == TUNED_JSON else path
    summary = read_result_json(folder / TUNED_JSON, TunedFile, "mbw tune")
    arrays = read_result_arrays(folder / FRF_NPZ, "mbw tune")
    try:
        levels = {
            name: LevelFrfs(
                outputs=tuple(map(str, arrays[f"{name}_outputs"])),
                tests=tuple(map(str, arrays[f"{name}_tests"])),
                **{
                    key: arrays[f"{name}_{key}"]
                    for key in ("measured", "as_drawn", "tuned", "noise", "deviation", "held_out")
                    if f"{name}_{key}" in arrays
                },
            )
            for name in LEVELS
        }
        return TuningResult(summary, arrays["freq_hz"], levels)
    except (KeyError, TypeError) as error:
        raise InputError(f"{folder} holds no tuning ({error}): run mbw tune again") from error
