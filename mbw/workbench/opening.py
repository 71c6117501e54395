"""Opening of a campaign, a model, or a folder of results for the workbench."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from diagnosis.corrections import find_correction
from diagnosis.verdict.schema import CauseRow
from identification import Fault
from identification.readers.campaign_toml import find_campaign_file
from identification.readers.result_files import read_result_json
from identification.result.stored_result import MODES_JSON
from identification.words import (
    InputError,
    Tolerance,
)
from identification.words.file_access import real_path
from mbmodel import load_machine, machine_model, mjcf_files, model_modes
from mbw.output_folder import folder_beside, source_of
from mbw.remarks import list_reading_options
from mbw.results.diagnosed_files import read_result as read_diagnosis
from mbw.results.diagnosed_schema import ShownFile
from mbw.results.measured_modes import read_measured_modes
from mbw.workbench.causes import ShownVerdict
from mbw.workbench.subject import StoredFrfs, WorkbenchSubject, hash_rows
from tuning import open_session, parametrise, read_result
from tuning.files.input_files import hash_files, input_rows
from tuning.files.plant_folder import (
    AUGMENTED,
    DIAGNOSE_VERB,
    SHOWN,
    VERDICT,
    HeldOutResult,
    read_held_out,
)
from tuning.files.result import TUNED_JSON, TUNED_MJCF
from tuning.files.schema import InputRow

N_LINES = 801  # of a model without a test, evenly spaced on a logarithmic axis
_RESULT_FILES = {"tuned": TUNED_JSON, "diagnosed": VERDICT, "modes": MODES_JSON}


def open_subject(path: Path, band: tuple[float, float] | None, key: str | None) -> WorkbenchSubject:
    """Read a campaign, a model, or a folder of results with the campaign that it was made from.

    Args:
        path: folder or campaign.toml, MJCF or URDF, or folder of ``mbw tune``, ``diagnose``,
            ``identify``.
        band: lowest and highest frequency [Hz]; None for the verb's own choice.
        key: keyframe of a model that was opened; None for its default.

    Raises:
        InputError: the path is none of these, or cannot be read.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist: name a campaign, model or folder of results")
    if path.is_file() and path.suffix != ".toml":
        return _open_model(path, band, key)
    if key is not None:
        raise InputError(f"--key is for a model alone: state key in the campaign.toml of {path}")
    file = next((f for f in _RESULT_FILES.values() if (path / f).is_file()), None)
    if file is None:
        if path.suffix != ".toml" and not (path / "campaign.toml").is_file():
            raise InputError(
                f"{path} is no campaign, model or folder of results: name a folder with a "
                "campaign.toml, an MJCF or URDF, or a folder that mbw tune, diagnose or identify "
                "wrote"
            )
        return _open_campaign(path, find_campaign_file(path), band)
    source = source_of(path, file)
    if source is None or not source.is_file():
        where = "the folder does not name it" if source is None else source
        raise InputError(f"{path}: its campaign is missing ({where}): open the campaign itself")
    if source.suffix != ".toml":
        raise InputError(f"{path} was made from a model alone: open {source}")
    return _open_campaign(path, source, band)


def _open_model(path: Path, band: tuple[float, float] | None, key: str | None) -> WorkbenchSubject:
    """Open a model alone: everything varies that a campaign could tune of it."""
    machine = load_machine(path, key=key)
    model = machine_model(machine)
    poles = model_modes(model, model.drawn).poles
    moving = np.abs(poles[poles.imag > 0]) / (2 * np.pi)
    if not model.parameters or not moving.size:
        raise InputError(f"{path}: nothing of this machine oscillates: add springs to its joints")
    low, high = band or (0.3 * float(moving.min()), 1.15 * float(moving.max()))
    return WorkbenchSubject(
        path=path,
        source=path,
        model=model,
        parametrisation=parametrise(model, Tolerance()),
        campaign=None,
        freq_hz=np.geomspace(low, high, N_LINES),
        quantity="accelerance",
        hashes=("", _hash_model(path, path.parent, key)),
        source_content=path.read_bytes(),
        remarks=machine.remarks,
    )


def _open_campaign(path: Path, source: Path, band: tuple[float, float] | None) -> WorkbenchSubject:
    """Open a campaign with the results that were made from it, here or beside it."""
    folders = {
        suffix: folder
        for suffix, file in _RESULT_FILES.items()
        for folder in (folder_beside(source, suffix), path)  # what was opened counts
        if _is_result_of(source, folder, file)
    }
    tuned = read_result(folders["tuned"]).summary if "tuned" in folders else None
    session = open_session(source, band or _find_band(path, folders))
    campaign = session.campaign.leave_out_after()
    rows = input_rows(session)
    remarks = campaign.remarks
    if tuned is not None and (changed := _changed_files(tuned.inputs, rows)):
        remarks += (f"{folders['tuned']} was made before {', '.join(changed)} changed",)
    subject = WorkbenchSubject(
        path=path,
        source=source,
        model=session.model,
        parametrisation=session.parametrisation,
        campaign=campaign,
        freq_hz=campaign.freq_hz,
        quantity=campaign.tests[0].estimate.frf.quantity,
        hashes=(hash_rows(rows), _hash_model(session.model.machine.source, source.parent)),
        source_content=source.read_bytes(),
        result=path if path.is_dir() and path in folders.values() else None,
        remarks=remarks,
    )
    return show_results(subject, folders)


def _find_band(path: Path, folders: Mapping[str, Path]) -> tuple[float, float] | None:
    """Return the band of the fit that was opened, else of one beside it; None without any."""
    if "diagnosed" in folders and ("tuned" not in folders or folders["diagnosed"] == path):
        return read_result_json(folders["diagnosed"] / SHOWN, ShownFile, DIAGNOSE_VERB).band
    return read_result(folders["tuned"]).summary.band if "tuned" in folders else None


def _hash_model(path: Path, folder: Path, key: str | None = None) -> str:
    """Return the hash of the files of a model and of how it is read."""
    how = " ".join([key or "", *list_reading_options()]).strip()
    return hash_rows(hash_files(mjcf_files(path), folder), how)


def show_results(subject: WorkbenchSubject, folders: Mapping[str, Path]) -> WorkbenchSubject:
    """Return a subject with results of earlier verbs, in place of those of the same verb.

    Args:
        subject: a campaign.
        folders: of results by ``tuned``, ``diagnosed`` and ``modes``.

    Raises:
        InputError: a result cannot be read.
    """
    if subject.campaign is None:
        return subject
    tuned, modes = subject.tuned, subject.measured_modes
    stored, remarks = dict(subject.stored), list(subject.remarks)
    readers: dict[str, Callable[[], HeldOutResult]] = {
        "tuned": lambda: read_held_out(folders["tuned"] / TUNED_MJCF),
        "diagnosed": lambda: read_held_out(folders["diagnosed"] / AUGMENTED),
    }
    for name, read in readers.items():
        if name not in folders:
            continue
        frfs = _read_frfs(read(), subject)
        if frfs is None:
            remarks.append(
                f"{folders[name]} has other frequency lines, and its curves are not shown"
            )
        elif name == "diagnosed":
            causes = read_diagnosis(folders[name]).verdict.causes
            stored[name] = _as_recorded(frfs, subject, causes)
        else:
            stored[name] = frfs
    if "tuned" in folders:
        tuned = read_result(folders["tuned"]).summary
    verdict = subject.verdict
    if "diagnosed" in folders:
        verdict = ShownVerdict.of(read_diagnosis(folders["diagnosed"]), subject.campaign)
        if not verdict.fitted_values():
            remarks.append(
                f"{folders['diagnosed']} is by an earlier version and does not hold its fit: "
                "diagnose again to switch its causes"
            )
    if "modes" in folders:
        modes = read_measured_modes(folders["modes"], subject.campaign)
    return replace(
        subject,
        tuned=tuned,
        stored=stored,
        measured_modes=modes,
        verdict=verdict,
        remarks=tuple(dict.fromkeys(remarks)),
    )


def _is_result_of(source: Path, folder: Path, file: str) -> bool:
    """Return whether a folder holds a result that was made from this campaign."""
    needed = {VERDICT: SHOWN}.get(file, file)
    if not all((folder / name).is_file() for name in (file, needed)):
        return False
    made_from = source_of(folder, file)
    return made_from is not None and real_path(made_from) == real_path(source)


def _read_frfs(result: HeldOutResult, subject: WorkbenchSubject) -> StoredFrfs | None:
    """Return the FRFs of a result at the sensors; None if its lines are not the campaign's."""
    lines, frfs = result.freq_hz, result.levels["sensors"]
    if lines.shape != subject.freq_hz.shape or not np.allclose(lines, subject.freq_hz, rtol=1e-9):
        return None
    # A copy of the campaign names files, and hits where sites moved, in other ways.
    names = tuple(dict.fromkeys(frfs.tests))
    shown = subject.tests if len(names) == len(subject.tests) else names
    test_of = dict(zip(names, shown, strict=True))
    labels = zip(map(test_of.__getitem__, frfs.tests), frfs.outputs, strict=True)
    return StoredFrfs({label: column for column, label in enumerate(labels)}, frfs.tuned)


def _as_recorded(
    frfs: StoredFrfs, subject: WorkbenchSubject, causes: Iterable[CauseRow]
) -> StoredFrfs:
    """Return FRFs with the channels exchanged and turned as in the records.

    A diagnosis corrects the records for such a fault; the same correction takes it back.
    """
    faults = [
        Fault(cause.effect, cause.location, cause.dof, 1.0, {}, 0.0)
        for cause in causes
        if cause.effect in ("sensor_swap", "sensor_polarity")
    ]
    if not faults or subject.campaign is None:
        return frfs
    tests = []
    for name, test in zip(subject.tests, subject.campaign.tests, strict=True):
        values = test.estimate.frf.values.copy()
        for row, output in enumerate(test.estimate.frf.outputs):
            if (name, str(output)) in frfs.column:
                values[:, row, 0] = frfs.values[:, frfs.column[name, str(output)]]
        frf = replace(test.estimate.frf, values=values)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf)))
    campaign = replace(subject.campaign, tests=tuple(tests))
    for fault in faults:
        correct = find_correction(fault, campaign)
        campaign = campaign if correct is None else correct(campaign)
    recorded = {
        (name, str(output)): test.estimate.frf.values[:, row, 0]
        for name, test in zip(subject.tests, campaign.tests, strict=True)
        for row, output in enumerate(test.estimate.frf.outputs)
        if (name, str(output)) in frfs.column
    }
    columns = {label: column for column, label in enumerate(recorded)}
    return StoredFrfs(columns, np.stack(list(recorded.values()), axis=1))


def _changed_files(then: Iterable[InputRow], now: Iterable[InputRow]) -> list[str]:
    """Return the files whose content changed since a result was made."""
    hashes = {row.file: row.sha256 for row in now}
    return [row.file for row in then if hashes.get(row.file, row.sha256) != row.sha256]
