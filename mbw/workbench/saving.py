"""Saving of a state as MJCF and campaign.toml, which every verb reads."""

from pathlib import Path

from identification.words import InputError, Real, UsageError
from mbmodel import MjcfLack, WrittenModel, write_model
from mbw.output_folder import ResultOptions
from mbw.remarks import describe_not_in_mjcf
from mbw.workbench.edits import added_delays
from mbw.workbench.state import SessionState
from mbw.workbench.subject import WorkbenchSubject
from tuning import open_session, predict
from tuning.assessment.gap import relative_change
from tuning.files.result import final_folder
from tuning.files.states_campaign import CAMPAIGN, write_campaign_with_model

SAVED_MODEL = "model.xml"


def save_state(
    subject: WorkbenchSubject, state: SessionState, outputs: ResultOptions, suffix: str = "opened"
) -> list[str]:
    """Write a state as MJCF, and as campaign.toml if there are tests, and read both back.

    The file is compared with the machine in memory, and its FRFs with those of the state.

    Args:
        subject: model and tests.
        state: what is saved.
        outputs: folder, and whether files of another campaign or model may be replaced.
        suffix: of the default folder beside the source.

    Returns:
        Sentences: where the files are, and what an MJCF cannot hold.

    Raises:
        UsageError: the folder is that of the campaign or of the model, or what was opened has
            changed on the disk.
        InputError: the folder cannot be written, or holds files of another campaign.
    """
    check_unchanged(subject)
    varies, model = subject.parametrisation, subject.model
    theta = varies.theta(state.x(varies.names))
    names = (SAVED_MODEL,) if subject.campaign is None else (SAVED_MODEL, CAMPAIGN)
    sources = {path.resolve().parent for path in (subject.source, model.machine.source)}
    with outputs.open("open", subject.source, suffix, names) as output:
        if output.path.resolve() in sources:
            raise UsageError(f"{output.path} holds what was opened: name another folder with --out")
        with output.write() as place:
            folder = final_folder(place)
            written = write_model(model, theta, place / SAVED_MODEL, folder)
            if subject.campaign is not None:
                delays = added_delays(subject.edits)
                write_campaign_with_model(subject.source, SAVED_MODEL, place, folder, delays)
        return _describe(subject, theta, written, output.path)


def check_unchanged(subject: WorkbenchSubject) -> None:
    """Refuse a subject whose files have changed on the disk since it was opened.

    Raises:
        UsageError: the sentence says what to do.
    """
    try:
        is_same = subject.source.read_bytes() == subject.source_content and (
            subject.campaign is None or subject.hash_campaign() == subject.hashes[0]
        )
    except (OSError, InputError):
        is_same = False
    if not is_same:
        raise UsageError(
            f"{subject.source}, or a file that it names, has changed since it was opened: open it "
            "again"
        )


def _describe(
    subject: WorkbenchSubject, theta: Real, written: WrittenModel, folder: Path
) -> list[str]:
    """Return sentences on files that were written, which are read back for it."""
    if subject.campaign is None:
        sentences, change = [f"{SAVED_MODEL} is in {folder}"], None
    else:
        sentences = [f"{SAVED_MODEL} and {CAMPAIGN} are in {folder}"]
        band = float(subject.freq_hz[0]), float(subject.freq_hz[-1])
        saved = open_session(folder, band)
        change = relative_change(
            predict(saved.model, saved.model.drawn, subject.campaign),
            predict(subject.model, theta, subject.campaign),
        )
    if written.difference:
        sentences.append(f"do not use {SAVED_MODEL}: it is not this machine ({written.difference})")
    if subject.campaign is None and added_delays(subject.edits):
        sentences.append("delays are not saved: a model alone has no control loops")
    is_elsewhere = subject.campaign is not None  # campaign.toml has the loops
    lacks = [
        str(lack)
        for lack in written.not_held
        if not (is_elsewhere and lack.reason == MjcfLack.LOOP)
    ]
    missing = describe_not_in_mjcf(lacks, change, SAVED_MODEL)
    return [*sentences, missing.replace("tuned ", "")] if missing else sentences
