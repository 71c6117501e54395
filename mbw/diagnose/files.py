"""Files of ``mbw diagnose``: writing three JSON files, arrays and an MJCF; reading them back."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagnosis import Diagnosis, Verdict
from diagnosis.inference.evidence import Evidence
from identification.readers.result_files import read_result_arrays, read_result_json
from identification.words import InputError, Real
from mbmodel import WrittenModel, write_model
from mbw.diagnose.machine_rows import restore_machine
from mbw.diagnose.result import StoredDiagnosis
from mbw.diagnose.schema import ShownFile
from tuning import Session
from tuning.control_loops.loops_file import LOOPS_JSON, write_loops
from tuning.files.result import TUNED_JSON, TUNED_MJCF, final_folder, not_held_error

VERDICT, EVIDENCE = "verdict.json", "evidence.json"
SHOWN, ARRAYS, PAGE = "diagnosis.json", "diagnosis.npz", "report.html"
AUGMENTED = "augmented.xml"
CHECKPOINT = "diagnose.checkpoint.json"
NAMES = (VERDICT, EVIDENCE, SHOWN, ARRAYS, AUGMENTED, LOOPS_JSON, PAGE)
_VERB = "mbw diagnose"
_RESULT_OF = {TUNED_MJCF: TUNED_JSON, AUGMENTED: VERDICT}  # MJCF of a result, and its JSON file


def result_file(path: Path) -> Path | None:
    """Return the JSON file of the tuning or diagnosis that wrote an MJCF; None of any other."""
    name = _RESULT_OF.get(path.name)
    return path.parent / name if name is not None and (path.parent / name).is_file() else None


def write_files(result: StoredDiagnosis, folder: Path) -> None:
    """Write JSON files and arrays into an existing folder."""
    rows = {VERDICT: result.verdict, EVIDENCE: result.evidence, SHOWN: result.shown}
    for name, row in rows.items():
        (folder / name).write_text(row.model_dump_json(indent=1) + "\n", encoding="utf-8")
    np.savez_compressed(folder / ARRAYS, allow_pickle=False, **result.arrays)


@dataclass(frozen=True)
class WrittenAugmented:
    """The augmented MJCF.

    Args:
        written: what became of it.
        not_held_error: relative change of the FRFs without what it cannot hold; None if it holds
            all.
    """

    written: WrittenModel
    not_held_error: float | None


def write_augmented(diagnosis: Diagnosis, target: Path) -> WrittenAugmented:
    """Write the tuned MJCF with the established causes, beside it the control loops of the test."""
    session, theta = find_established_fit(diagnosis)
    model = session.model
    stated = model.without_small_sizes(theta)
    write_loops(model.machine.loops, target.with_name(LOOPS_JSON))
    written = write_model(model, stated, target, final_folder(target.parent))
    error = not_held_error(model, stated, session.campaign) if written.not_held else None
    return WrittenAugmented(written, error)


def find_established_fit(diagnosis: Diagnosis) -> tuple[Session, Real]:
    """Return session and parameters of the fit that has the established causes alone."""
    present = diagnosis.present
    fitted = {cause.key for cause in present.causes if cause not in diagnosis.gross_hypotheses}
    wanted = fitted & set(present.established)
    if wanted == fitted and diagnosis.after and diagnosis.parameters:
        return diagnosis.after.refit.session, diagnosis.parameters.theta
    refit = diagnosis.search.refit_of(tuple(wanted)) if wanted else None
    refit = refit or diagnosis.retuned.refit
    return refit.session, refit.fit.theta


def read_result(path: Path) -> StoredDiagnosis:
    """Read the result that ``mbw diagnose`` wrote.

    Args:
        path: folder of the result, or a file in it.

    Raises:
        InputError: a file is missing, broken or of another version.
    """
    folder = path if path.is_dir() else path.parent
    verdict = read_result_json(folder / VERDICT, Verdict, _VERB)
    evidence = read_result_json(folder / EVIDENCE, Evidence, _VERB)
    shown = read_result_json(folder / SHOWN, ShownFile, _VERB)
    result = StoredDiagnosis(verdict, evidence, shown, read_result_arrays(folder / ARRAYS, _VERB))
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
