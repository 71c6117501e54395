"""What a tuning leaves behind: tuned.json, the tuned MJCF, the FRFs."""

import os
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from pydantic import ValidationError

from identification.words import Complex, InputError, Real
from mbmodel import modes_of_matrices, write_mjcf
from tuning.assessment.gap import Gap, block_shares
from tuning.campaign_tuning import Comparison, Tuned
from tuning.files.input_files import inputs
from tuning.files.mode_pair_rows import pair_rows
from tuning.files.parameter_rows import fit_row, parameter_rows
from tuning.files.schema import (
    BlockRow,
    GapRow,
    GapTable,
    LevelGap,
    ModeRow,
    ShareRow,
    TestRow,
    TunedFile,
)

TUNED_JSON, TUNED_MJCF, FRF_NPZ = "tuned.json", "tuned.xml", "frf.npz"
LEVELS = ("sensors", "bodies")
_MOST = 100  # correlations that are written


@dataclass(frozen=True, eq=False)
class Level:
    """FRFs of one level, all tests side by side.

    Args:
        outputs: labels of the channels; n_channel.
        tests: label of each channel's test; n_channel.
        measured, as_drawn, tuned: (n_freq, n_channel).
        noise: standard deviation of the measured values; (n_freq, n_channel).
        deviation: standard deviation of the tuned model's magnitudes; None if interrupted.
    """

    outputs: tuple[str, ...]
    tests: tuple[str, ...]
    measured: Complex
    as_drawn: Complex
    tuned: Complex
    noise: Real
    deviation: Real | None = None


@dataclass(frozen=True, eq=False)
class Result:
    """A tuning as read back from its folder."""

    summary: TunedFile
    freq_hz: Real
    levels: dict[str, Level]


def summarise_tuning(
    tuned: Tuned, remaining: Sequence[ShareRow] = (), not_held: Sequence[str] = ()
) -> TunedFile:
    """The content of tuned.json."""
    session = tuned.session
    model, campaign = session.model, session.campaign
    freq, theta = campaign.freq_hz, tuned.model_fit.theta
    own = {"as_drawn": _modes(tuned, model.drawn), "tuned": _modes(tuned, theta)}
    pairs, unpaired = (
        ([], []) if tuned.measured is None else pair_rows(model, tuned.measured, theta, own)
    )
    gap = GapTable(sensors=_level_gap(tuned.sensors), bodies=_level_gap(tuned.bodies))
    sure = tuned.sure
    return TunedFile(
        campaign=campaign.name,
        model=model.machine.name,
        quantity=campaign.tests[0].estimate.frf.quantity,
        band=(float(freq[0]), float(freq[-1])),
        lines=len(freq),
        interrupted=tuned.interrupted,
        held_out_outcomes=list(tuned.held_out.outcomes) if tuned.held_out else [],
        held_out_blocks=_blocks(tuned),
        tests=[
            TestRow(
                file=test.condition.test,
                reference=str(test.condition.reference),
                level=test.condition.level_n,
                averages=test.estimate.averages,
                variance_from=test.estimate.variance_source,
                channels=len(test.estimate.frf.outputs),
            )
            for test in campaign.tests
        ],
        fit=fit_row(tuned, gap.bodies if tuned.at == "bodies" else gap.sensors),
        gap=gap,
        parameters=parameter_rows(tuned),
        correlations=[] if sure is None else list(sure.correlations()[:_MOST]),
        unseen=[] if sure is None else list(sure.unseen()),
        information=list(tuned.gains),
        inputs=inputs(session),
        modes=own,
        residuals=list(tuned.residuals),
        at=tuned.at,
        pairs=pairs,
        unpaired_modes=unpaired,
        remaining_gap=list(remaining),
        not_held_by_mjcf=list(not_held),
    )


def _level_gap(comparison: Comparison) -> LevelGap:
    drawn, tuned = comparison.gap(comparison.as_drawn), comparison.gap(comparison.bounded)
    held_out = comparison.held_out
    return LevelGap(
        as_drawn=_gap_row(drawn),
        tuned=_gap_row(tuned),
        held_out=None if held_out is None else _gap_row(comparison.gap(held_out)),
        noise=drawn.noise,
        channels=drawn.channels,
        quiet_channels=drawn.quiet,
    )


def _blocks(tuned: Tuned) -> list[BlockRow]:
    sensors, held_out = tuned.sensors, tuned.held_out
    if held_out is None or sensors.held_out is None:
        return []
    freq = sensors.campaign.freq_hz
    shares = block_shares(sensors.held_out, sensors.campaign, held_out.width)
    return [
        BlockRow(
            low=float(freq[start]),
            high=float(freq[min(start + held_out.width, len(freq)) - 1]),
            share=float(share),
        )
        for start, share in zip(range(0, len(freq), held_out.width), shares, strict=True)
    ]


def _gap_row(gap: Gap) -> GapRow:
    return GapRow(error=gap.error, excess=gap.excess)


def _modes(tuned: Tuned, theta: Real) -> list[ModeRow]:
    found = modes_of_matrices(tuned.session.model.matrices(theta))
    lowest, highest = tuned.session.campaign.freq_hz[[0, -1]]
    return [
        ModeRow(frequency=float(frequency), damping=float(damping))
        for frequency, damping, pole in zip(found.freq_hz, found.damping, found.poles, strict=True)
        if pole.imag > 0 and lowest <= frequency <= highest
    ]


def write_result(tuned: Tuned, folder: Path, remaining: Sequence[ShareRow] = ()) -> TunedFile:
    """Write tuned.json, tuned.xml and frf.npz, each whole or not at all.

    Args:
        tuned: what to write.
        folder: made if it is not there; files of these names in it are replaced.
        remaining: where the gap that remains shows, by the diagnosis.
    """
    model, theta = tuned.session.model, tuned.model_fit.theta
    edits = model.edits(theta)
    with files_of(folder) as place:
        not_held = write_mjcf(model.machine.source, place / TUNED_MJCF, edits)
        np.savez_compressed(place / FRF_NPZ, allow_pickle=False, **_arrays(tuned))
        summary = summarise_tuning(tuned, remaining, [str(missing) for missing in not_held])
        (place / TUNED_JSON).write_text(summary.model_dump_json(indent=1) + "\n", "utf-8")
    return summary


@contextmanager
def files_of(folder: Path) -> Iterator[Path]:
    """A temporary folder inside another, whose files move up when the block ends without error."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".writing-") as name:
            yield Path(name)
            files = sorted(Path(name).iterdir())
            for file in files:
                if (folder / file.name).is_dir():
                    raise InputError(f"{folder / file.name} is a folder: name another")
            for file in files:
                os.replace(file, folder / file.name)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be made or written ({error.strerror}): name another"
        ) from error


def check_folder(folder: Path) -> None:
    """Refuse a folder into which a result cannot be written, before the work is done.

    Raises:
        InputError: it cannot be made or written, or holds folders in the places of the files.
    """
    with files_of(folder) as place:
        for name in (TUNED_JSON, TUNED_MJCF, FRF_NPZ):
            if (folder / name).is_dir():
                raise InputError(f"{folder / name} is a folder: name another")
        (place / ".probe").touch()
        (place / ".probe").unlink()


def _arrays(tuned: Tuned) -> dict[str, np.ndarray]:
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
        arrays[f"{name}_measured"] = _beside([test.estimate.frf.values for test in tests])
        arrays[f"{name}_as_drawn"] = _beside(comparison.as_drawn)
        arrays[f"{name}_tuned"] = _beside(comparison.tuned)
        if comparison.deviation is not None:
            arrays[f"{name}_deviation"] = _beside(comparison.deviation).real.astype(np.float32)
        if comparison.held_out is not None:
            arrays[f"{name}_held_out"] = _beside(comparison.held_out)
        noise = [np.sqrt(test.estimate.variance[:, :, 0]) for test in tests]
        arrays[f"{name}_noise"] = np.hstack(noise).astype(np.float32)
    return arrays


def _beside(values: "Sequence[Complex] | Sequence[Real]") -> np.ndarray:
    return np.hstack([value[:, :, 0] for value in values]).astype(np.complex64)


def read_result(path: Path) -> Result:
    """Read the folder of a tuning (or its tuned.json).

    Raises:
        InputError: files that are missing or not of this kind.
    """
    folder = path.parent if path.name == TUNED_JSON else path
    try:
        summary = TunedFile.model_validate_json((folder / TUNED_JSON).read_bytes())
        with (
            (folder / FRF_NPZ).open("rb") as file,
            np.load(file, allow_pickle=False) as arrays,
        ):
            levels = {
                name: Level(
                    outputs=tuple(map(str, arrays[f"{name}_outputs"])),
                    tests=tuple(map(str, arrays[f"{name}_tests"])),
                    **{
                        key: arrays[f"{name}_{key}"]
                        for key in ("measured", "as_drawn", "tuned", "noise", "deviation")
                        if f"{name}_{key}" in arrays
                    },
                )
                for name in LEVELS
            }
            return Result(summary, arrays["freq_hz"], levels)
    except FileNotFoundError as error:
        raise InputError(
            f"{error.filename} does not exist: name the folder that mbw tune wrote"
        ) from error
    except (
        ValidationError,
        ValueError,
        KeyError,
        OSError,
        EOFError,
        BadZipFile,
        zlib.error,
    ) as error:
        raise InputError(f"{folder} holds no tuning ({error}): run mbw tune again") from error
