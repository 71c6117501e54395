"""Subject of the workbench: a model with its parameters, its tests, and earlier results."""

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from identification.readers.campaign_toml import find_campaign_file
from identification.words import (
    Campaign,
    Complex,
    InputError,
    Layout,
    ModalModel,
    Quantity,
    Real,
    Tolerance,
)
from identification.words.file_access import real_path
from mbmodel import Model, load_machine, machine_model, mjcf_files, model_modes
from mbw.output_folder import folder_beside, source_of
from mbw.results.identified_files import MODES_JSON
from mbw.results.measured_modes import read_measured_modes
from mbw.site_kinds import hammer_sites, sensor_sites
from mbw.workbench.edits import MachineEdit
from mbw.workbench.state import SessionState, View
from tuning import Parametrisation, TunedFile, open_session, parametrise, read_result
from tuning.files.input_files import hash_files, input_rows
from tuning.files.plant_folder import AUGMENTED, SHOWN, VERDICT, HeldOutResult, read_held_out
from tuning.files.result import TUNED_JSON, TUNED_MJCF
from tuning.files.schema import InputRow

N_LINES = 801  # of a model without a test, evenly spaced on a logarithmic axis
_RESULT_FILES = {"tuned": TUNED_JSON, "diagnosed": VERDICT, "modes": MODES_JSON}


@dataclass(frozen=True, eq=False)
class StoredFrfs:
    """FRFs of an earlier verb at the measured channels.

    Args:
        column: column of each test and output, by their labels.
        values: FRFs on the lines of the campaign; (n_freq, n_column).
    """

    column: dict[tuple[str, str], int]
    values: Complex


@dataclass(frozen=True, eq=False)
class WorkbenchSubject:
    """A model with what can vary, its tests, and results of earlier verbs.

    Args:
        path: what the user opened.
        source: campaign.toml, or the MJCF.
        model: nominal model with everything that can vary as Parts.
        parametrisation: coordinates of the parameters.
        campaign: tests on the lines of the band; None for a model alone.
        freq_hz: lines of all curves; (n_freq,).
        quantity: quantity of all curves.
        hashes: hash of the campaign's and of the model's files.
        source_content: content of the source when it was opened.
        tuned: summary of a tuning; None without one.
        stored: FRFs of earlier verbs, by ``tuned`` and ``diagnosed``.
        measured_modes: modes that were identified; None without any.
        result: folder of results that was opened, with a page of its own; None for another path.
        remarks: findings on all of this, one sentence each.
        edits: what is added to the machine.
    """

    path: Path
    source: Path
    model: Model
    parametrisation: Parametrisation
    campaign: Campaign | None
    freq_hz: Real
    quantity: Quantity
    hashes: tuple[str, str]
    source_content: bytes
    tuned: TunedFile | None = None
    stored: Mapping[str, StoredFrfs] = field(default_factory=dict)
    measured_modes: ModalModel | None = None
    result: Path | None = None
    remarks: tuple[str, ...] = ()
    edits: tuple[MachineEdit, ...] = ()

    @property
    def name(self) -> str:
        """Name of the campaign, or of the machine."""
        return self.model.machine.name if self.campaign is None else self.campaign.name

    @property
    def tests(self) -> tuple[str, ...]:
        """Label of each test."""
        if self.campaign is None:
            return ()
        conditions = (test.condition for test in self.campaign.tests)
        return tuple(f"{each.reference} in {each.test}" for each in conditions)

    def find_port(self, reference: str) -> str:
        """Return the label of an input, without the file in which it was measured."""
        tests = () if self.campaign is None else self.campaign.tests
        ports = (str(test.condition.reference) for test in tests)
        return dict(zip(self.tests, ports, strict=True)).get(reference, reference)

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Bounds of every coordinate, by name."""
        varies = self.parametrisation
        ends = zip(varies.lower.tolist(), varies.upper.tolist(), strict=True)
        return dict(zip(varies.names, ends, strict=True))

    def tuned_x(self) -> dict[str, float]:
        """Return the coordinates of the tuned model; empty without one."""
        if self.tuned is None:
            return {}
        return self.coordinates({row.name: row.tuned for row in self.tuned.parameters})

    def coordinates(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return x of every coordinate within its bounds, zero where no value is given.

        Args:
            values: values of parameters [SI], by name.
        """
        varies = self.parametrisation
        theta = [values.get(each.name, each.drawn) for each in varies.parameters]
        x = varies.coordinates(np.where(varies.free, theta, varies.fixed))
        within = np.clip(np.nan_to_num(x), varies.lower, varies.upper)
        return dict(zip(varies.names, within.tolist(), strict=True))

    def first_state(self) -> SessionState:
        """Return the state at which a session begins: as drawn, or as tuned if that was opened."""
        layout = self.model.machine.layout
        if self.campaign is not None:
            frf = self.campaign.tests[0].estimate.frf
            view = View(self.tests[0], str(_drive_channel(frf.inputs[0], frf.outputs)))
        else:
            point = next(iter((*hammer_sites(layout), *sensor_sites(layout), *layout.bodies)))
            view = View(f"{point}:+tx", f"{point}:+tx")
        state = SessionState(*self.hashes, view)
        return state.move(self.tuned_x()) if self.result is not None else state


def _drive_channel(reference: object, outputs: Iterable[object]) -> object:
    """Return the output at the reference itself if it was measured, else the first."""
    listed = list(outputs)
    return reference if reference in listed else listed[0]


def open_subject(path: Path, band: tuple[float, float] | None, key: str | None) -> WorkbenchSubject:
    """Read a campaign, a model, or a folder of results with the campaign that it was made from.

    Args:
        path: folder or campaign.toml, MJCF, or folder of ``mbw tune``, ``diagnose``, ``identify``.
        band: lowest and highest frequency [Hz]; None for the verb's own choice.
        key: keyframe of a model that was opened; None for its default.

    Raises:
        InputError: the path is none of these, or cannot be read.
    """
    if path.is_file() and path.suffix == ".xml":
        return _open_model(path, band, key)
    file = next((f for f in _RESULT_FILES.values() if (path / f).is_file()), None)
    if file is None:
        if path.suffix != ".toml" and not (path / "campaign.toml").is_file():
            raise InputError(
                f"{path} is no campaign, model or folder of results: name a folder with a "
                "campaign.toml, an MJCF (.xml), or a folder that mbw tune, diagnose or identify "
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
        hashes=("", _hash(hash_files(mjcf_files(path), path.parent))),
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
    session = open_session(source, band or (None if tuned is None else tuned.band))
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
        hashes=(
            _hash(rows),
            _hash(hash_files(mjcf_files(session.model.machine.source), source.parent)),
        ),
        source_content=source.read_bytes(),
        result=path if path.is_dir() and path in folders.values() else None,
        remarks=remarks,
    )
    return show_results(subject, folders)


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
        else:
            stored[name] = frfs
    if "tuned" in folders:
        tuned = read_result(folders["tuned"]).summary
    if "modes" in folders:
        modes = read_measured_modes(folders["modes"], subject.campaign)
    return replace(
        subject,
        tuned=tuned,
        stored=stored,
        measured_modes=modes,
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


def _changed_files(then: Iterable[InputRow], now: Iterable[InputRow]) -> list[str]:
    """Return the files whose content changed since a result was made."""
    hashes = {row.file: row.sha256 for row in now}
    return [row.file for row in then if hashes.get(row.file, row.sha256) != row.sha256]


def _hash(rows: Iterable[InputRow]) -> str:
    """Return one hash of all files."""
    text = "".join(f"{row.file} {row.sha256}\n" for row in rows)
    return hashlib.sha256(text.encode()).hexdigest()


def port_labels(layout: Layout) -> list[str]:
    """Return the labels of all points along their axes, and of all bodies in six directions."""
    axes = [f"{point}:+t{axis}" for point in layout.points for axis in "xyz"]
    return [*axes, *map(str, layout.body_dofs())]
