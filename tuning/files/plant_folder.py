"""Folder of a tuning or of a diagnosis as a plant: its MJCF, held-out FRFs, and doubts about it.

Both hold an MJCF with posterior.npz beside it: tuned.xml, or augmented.xml with the established
causes. The functions of this file give predictions access to either.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from pydantic import BaseModel

from identification.readers.result_files import read_result_arrays, read_result_json
from identification.words import InputError, Real, percent_text
from tuning.control_loops.loops_file import LOOPS_JSON
from tuning.files.posterior_file import POSTERIOR_NPZ
from tuning.files.result import FRF_NPZ, TUNED_JSON, TUNED_MJCF, LevelFrfs, read_result

AUGMENTED = "augmented.xml"
VERDICT, SHOWN, ARRAYS = "verdict.json", "diagnosis.json", "diagnosis.npz"
_RESULT_OF = {TUNED_MJCF: TUNED_JSON, AUGMENTED: VERDICT}  # MJCF of a result, and its JSON file
DIAGNOSE_VERB = "mbw diagnose"

HeldOutFit = Literal["retuned", "after"]  # array of diagnosis.npz with FRFs on held-out lines


class AlternativeRow(BaseModel):
    """Plant that may be the true one in place of augmented.xml.

    Args:
        name: causes of the plant, such as ``link@pair:a-b``, or ``no cause``.
        probability: probability of its set of causes, relative to all plants that are listed.
        file: name of its MJCF; a posterior with the suffix .npz lies beside it.
    """

    name: str
    probability: float
    file: str


class PlantRow(BaseModel):
    """What a diagnosis says of its plant, augmented.xml.

    Args:
        name: causes of the plant, or ``no cause``.
        probability: probability of its set of causes, relative to all plants that are listed.
        held_out: array of diagnosis.npz with its FRFs on held-out lines; null if there is none.
        doubts: reasons to doubt its fit, beside the verdict.
        alternatives: other plants that are probable.
    """

    name: str
    probability: float
    held_out: HeldOutFit | None = None
    doubts: list[str] = []
    alternatives: list[AlternativeRow] = []


class HeldOutResult(Protocol):
    """FRFs of a fit, measured and predicted on held-out lines."""

    @property
    def freq_hz(self) -> Real:
        """Lines [Hz]; (n_freq,)."""

    @property
    def levels(self) -> dict[str, LevelFrfs]:
        """FRFs at the ``sensors``."""

    @property
    def blocks(self) -> int:
        """Number of blocks of lines that were held out."""


class _Test(BaseModel):
    file: str
    reference: str


class _Channel(BaseModel):
    output: str
    test: int


class _Shown(BaseModel):
    """Keys of diagnosis.json that are needed here."""

    lines: int = 0
    block: int | None = None
    tests: list[_Test] = []
    channels: list[_Channel] = []
    corrected: list[int] = []
    plant: PlantRow | None = None


class _Rest(BaseModel):
    excess: float | None
    model_error: float


class _Verdict(BaseModel):
    """Keys of verdict.json that are needed here."""

    verdict: str
    rest: _Rest | None = None


class _Unseen(BaseModel):
    parameters: list[str]


class _Fit(BaseModel):
    converged: bool = True
    outcome: str = ""
    doubts: list[str] = []


class _Tuned(BaseModel):
    """Keys of tuned.json that are needed here."""

    fit: _Fit = _Fit()
    unseen: list[_Unseen] = []


class _DiagnosedFrfs:
    """FRFs of a diagnosis as those of a tuning."""

    def __init__(self, freq_hz: Real, frfs: LevelFrfs, blocks: int) -> None:
        self.freq_hz, self.levels, self.blocks = freq_hz, {"sensors": frfs}, blocks


def plant_file(path: Path) -> Path:
    """Return the MJCF of a folder of results; another path as it is.

    Args:
        path: folder of a tuning or diagnosis, or an MJCF.
    """
    if not path.is_dir():
        return path
    return next((path / name for name in _RESULT_OF if (path / name).is_file()), path / TUNED_MJCF)


def result_file(path: Path) -> Path | None:
    """Return the JSON file of the tuning or diagnosis that wrote an MJCF; None of any other."""
    name = _RESULT_OF.get(path.name)
    return path.parent / name if name is not None and (path.parent / name).is_file() else None


def has_posterior(path: Path) -> bool:
    """Return whether the posterior of an MJCF lies beside it."""
    return path.name in _RESULT_OF and (path.parent / POSTERIOR_NPZ).is_file()


def read_plant_row(path: Path) -> PlantRow | None:
    """Return what a diagnosis says of its plant; None for the MJCF of a tuning or of a user.

    Raises:
        InputError: a file of the diagnosis is damaged.
    """
    file = path.parent / SHOWN
    if path.name != AUGMENTED or not file.is_file():
        return None
    return read_result_json(file, _Shown, DIAGNOSE_VERB).plant


def read_held_out(path: Path) -> HeldOutResult:
    """Return the FRFs of the fit that wrote an MJCF, measured and on held-out lines.

    Raises:
        InputError: files that are missing or damaged.
    """
    folder = path.parent
    if path.name != AUGMENTED:
        return read_result(folder)
    shown = read_result_json(folder / SHOWN, _Shown, DIAGNOSE_VERB)
    arrays = read_result_arrays(folder / ARRAYS, DIAGNOSE_VERB)
    source = None if shown.plant is None or shown.block is None else shown.plant.held_out
    try:
        measured = np.array(arrays["measured"], complex)
        if source == "after":
            measured[:, shown.corrected] = arrays["corrected"]
        frfs = LevelFrfs(
            outputs=tuple(channel.output for channel in shown.channels),
            tests=tuple(
                f"{shown.tests[channel.test].reference} in {shown.tests[channel.test].file}"
                for channel in shown.channels
            ),
            measured=measured,
            as_drawn=arrays["retuned"],
            tuned=arrays[source or "retuned"],
            noise=arrays["noise"],
            held_out=None if source is None else arrays[source],
        )
        return _DiagnosedFrfs(arrays["freq_hz"], frfs, -(-shown.lines // (shown.block or 1)))
    except (KeyError, IndexError, ValueError) as error:
        raise InputError(
            f"{folder}: {SHOWN} and {ARRAYS} do not belong together: run {DIAGNOSE_VERB} again"
        ) from error


def held_out_beside(path: Path) -> HeldOutResult | None:
    """Return the held-out FRFs of the fit that wrote an MJCF, if their errors are the plant's.

    Returns:
        None if no fit of FRFs wrote the MJCF, or if loops were closed during its test: its errors
        are then those of the closed loops.

    Raises:
        InputError: files of the fit are damaged.
    """
    folder = path.parent
    names = (SHOWN, ARRAYS) if path.name == AUGMENTED else (TUNED_JSON, FRF_NPZ)
    is_there = all((folder / name).is_file() for name in names)
    return read_held_out(path) if is_there and not (folder / LOOPS_JSON).is_file() else None


def plant_doubts(path: Path) -> list[str]:
    """Return the doubts about the fit that wrote an MJCF, one sentence each; none for a drawing.

    Raises:
        InputError: a file of the fit is damaged.
    """
    file = result_file(path)
    if file is None:
        return []
    if file.name == TUNED_JSON:
        tuned = read_result_json(file, _Tuned, "mbw tune")
        doubts = [] if tuned.fit.converged else [f"the search ended early ({tuned.fit.outcome})"]
        names = [name for row in tuned.unseen for name in row.parameters]
        doubts += [*tuned.fit.doubts, *undetermined_doubts(names)]
    else:
        row = read_plant_row(path)
        doubts = [*_verdict_doubts(file), *([] if row is None else row.doubts)]
    return [f"In doubt by {file.name}: {text}." for text in doubts]


def undetermined_doubts(names: Sequence[str]) -> list[str]:
    """Return a sentence on parameters that the data do not determine; none without any."""
    listed = list(dict.fromkeys(names))
    if not listed:
        return []
    further = f" and {len(listed) - 3} more" if len(listed) > 3 else ""
    return [f"the data do not determine {', '.join(listed[:3])}{further}"]


def _verdict_doubts(file: Path) -> list[str]:
    """Return a sentence on what a diagnosis did not explain; none if it explained all."""
    verdict = read_result_json(file, _Verdict, DIAGNOSE_VERB)
    if verdict.verdict not in ("partly", "unexplained"):
        return []
    what = (
        "something is missing, and no effect is established as its cause"
        if verdict.verdict == "unexplained"
        else "something is missing beside the established causes"
    )
    rest = verdict.rest
    if rest is None:
        return [what]
    size = f"a model error of {percent_text(rest.model_error)} remains"
    if rest.excess is not None:
        size += f", and the error on held-out lines is {rest.excess:.3g} times the noise"
    return [f"{what}: {size}"]
