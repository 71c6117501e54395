"""Checkpoints of verbs that an interrupted call can resume from."""

from pathlib import Path

from mbw.interrupts import advise_at_end
from mbw.messages import SCREEN
from tuning import Checkpoint


def open_checkpoint(file: Path, key: str, work: str, *, resume: bool) -> Checkpoint:
    """Open the checkpoint of a run; say so where it is not used, and where there is none.

    Args:
        file: file of the checkpoint.
        key: fingerprint of inputs and options.
        work: what is interrupted, such as ``tuning``.
        resume: whether to continue from it.
    """
    if file.is_file() and not resume:
        SCREEN.say(f"{file} of an interrupted run is not used: --resume would continue from it")
    if resume and not file.exists():
        SCREEN.say(f"{file.parent} holds no interrupted run to resume: the {work} starts anew")
    checkpoint = Checkpoint(file, key, resume=resume)

    def advise() -> str:
        kept = len(checkpoint)
        return f"continue with --resume: finished steps are kept ({kept})" if kept else ""

    advise_at_end(advise)
    return checkpoint
