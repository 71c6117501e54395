"""Result of ``mbw diagnose``, written as three JSON files and arrays, and read back."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diagnosis import Verdict
from diagnosis.inference.evidence import Evidence
from identification.readers.result_files import (
    read_result_arrays,
    read_result_json,
    write_result_arrays,
)
from identification.words import InputError
from mbw.results.diagnosed_schema import ShownFile
from mbw.results.machine_rows import restore_machine
from tuning import POSTERIOR_NPZ
from tuning.control_loops.loops_file import LOOPS_JSON
from tuning.files.plant_folder import ARRAYS, AUGMENTED, DIAGNOSE_VERB, SHOWN, VERDICT

EVIDENCE, PAGE = "evidence.json", "report.html"
CHECKPOINT = "diagnose.checkpoint.json"
_MOST_ALTERNATIVES = 19  # of a probability of 5 % or more, beside the plant itself
ALTERNATIVES = tuple(  # MJCF and posterior of each plant that may be there in place of AUGMENTED
    f"alternative{number}.{suffix}"
    for number in range(1, _MOST_ALTERNATIVES + 1)
    for suffix in ("xml", "npz")
)
NAMES = (
    *(VERDICT, EVIDENCE, SHOWN, ARRAYS, AUGMENTED, POSTERIOR_NPZ, LOOPS_JSON, PAGE),
    *ALTERNATIVES,
)


@dataclass(frozen=True, eq=False)
class StoredDiagnosis:
    """Diagnosis as its folder holds it.

    Args:
        verdict: content of verdict.json.
        evidence: content of evidence.json, the evidence of the verdict.
        shown: content of diagnosis.json, names and labels.
        arrays: content of diagnosis.npz. FRFs are (n_freq, n_channel): ``measured``, ``retuned``
            and ``after``, the last without columns if there is no cause; ``noise`` is one standard
            deviation; ``corrected`` is the measurement without the effect, (n_freq, n_corrected).
            ``retuned_excess``, ``retuned_error``, ``after_excess`` and ``after_error`` are
            (n_channel,), nan if unknown; so is ``channel_noise``.
    """

    verdict: Verdict
    evidence: Evidence
    shown: ShownFile
    arrays: dict[str, Any]

    @property
    def has_after(self) -> bool:
        """Whether there are FRFs with the effect."""
        return bool(self.arrays["after"].size)


def write_files(result: StoredDiagnosis, folder: Path) -> None:
    """Write JSON files and arrays into an existing folder."""
    rows = {VERDICT: result.verdict, EVIDENCE: result.evidence, SHOWN: result.shown}
    for name, row in rows.items():
        (folder / name).write_text(row.model_dump_json(indent=1) + "\n", encoding="utf-8")
    write_result_arrays(folder / ARRAYS, result.arrays)


def read_result(path: Path) -> StoredDiagnosis:
    """Read the result that ``mbw diagnose`` wrote.

    Args:
        path: folder of the result, or a file in it.

    Raises:
        InputError: a file is missing, broken or of another version.
    """
    folder = path if path.is_dir() else path.parent
    verdict = read_result_json(folder / VERDICT, Verdict, DIAGNOSE_VERB)
    evidence = read_result_json(folder / EVIDENCE, Evidence, DIAGNOSE_VERB)
    shown = read_result_json(folder / SHOWN, ShownFile, DIAGNOSE_VERB)
    result = StoredDiagnosis(
        verdict, evidence, shown, read_result_arrays(folder / ARRAYS, DIAGNOSE_VERB)
    )
    try:
        _check(result)
    except (ValueError, KeyError, AttributeError, TypeError, OverflowError) as error:
        raise InputError(
            f"{folder}: {VERDICT}, {SHOWN} and {ARRAYS} do not belong together: run mbw diagnose "
            "again"
        ) from error
    return result


def _check(result: StoredDiagnosis) -> None:
    """Check that rows and arrays have matching sizes.

    Raises:
        ValueError: their sizes differ.
        KeyError: an array is missing.
    """
    shown, arrays = result.shown, result.arrays
    lines, channels = shown.lines, len(shown.channels)
    shapes: dict[str, tuple[int, ...]] = {
        "freq_hz": (lines,),
        "corrected": (lines, len(shown.corrected)),
        **dict.fromkeys(("measured", "retuned", "noise"), (lines, channels)),
        **{
            f"{step}_{name}": (channels,)
            for step in ("retuned", "after")
            for name in ("error", "excess")
        },
        "channel_noise": (channels,),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} is {arrays[name].shape}, expected {shape}")
    if arrays["after"].shape not in ((lines, 0), (lines, channels)):
        raise ValueError(f"after is {arrays['after'].shape}")
    count = len(result.verdict.causes)
    if len(shown.means) != count:
        raise ValueError("causes and their meanings differ in number")
    if not all(0 <= row.cause < count for row in shown.established):
        raise ValueError("an established cause has no row")
    restore_machine(shown.machine, arrays)
