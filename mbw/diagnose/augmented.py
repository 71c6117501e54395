"""The augmented MJCF of ``mbw diagnose``: the tuned one with the established causes."""

from dataclasses import dataclass
from pathlib import Path

from diagnosis import Diagnosis
from identification.words import Real
from mbmodel import WrittenModel, write_model
from tuning import Session
from tuning.control_loops.loops_file import LOOPS_JSON, write_loops
from tuning.files.result import final_folder, not_held_error


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
