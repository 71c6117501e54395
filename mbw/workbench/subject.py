"""Subject of the workbench: a model with its parameters, its tests, and earlier results."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np

from identification.words import (
    Campaign,
    Complex,
    Layout,
    ModalModel,
    Quantity,
    Real,
)
from mbmodel import Model
from mbw.site_kinds import hammer_sites, sensor_sites
from mbw.workbench.causes import ShownVerdict
from mbw.workbench.edits import MachineEdit
from mbw.workbench.state import SessionState, View
from tuning import Parametrisation, Session, TunedFile
from tuning.files.input_files import input_rows
from tuning.files.plant_folder import VERDICT
from tuning.files.schema import InputRow


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
        verdict: of a diagnosis; None without one.
        unedited: nominal model without what is added; None if this is it.
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
    verdict: ShownVerdict | None = None
    unedited: Model | None = None

    @property
    def drawn_model(self) -> Model:
        """Nominal model without what is added."""
        return self.unedited or self.model

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

    def diagnosed_x(self) -> dict[str, float]:
        """Return the coordinates of the fit of a diagnosis; empty without one."""
        fitted = {} if self.verdict is None else self.verdict.fitted_values()
        return self.with_causes().coordinates(fitted) if fitted else {}

    def hash_campaign(self) -> str:
        """Return the hash of the files of the campaign as they are on the disk."""
        if self.campaign is None:
            return ""
        session = Session(self.source, self.drawn_model, self.campaign, self.parametrisation)
        return hash_rows(input_rows(session))

    def with_causes(self) -> Self:
        """Return the subject whose model has the causes of the verdict, to be switched on."""
        if self.verdict is None or self.campaign is None:
            return self
        whole, varies = self.verdict.add_to(
            self.model, self.parametrisation, self.campaign.tolerance
        )
        return replace(self, model=whole, parametrisation=varies)

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
        if self.result is None:
            return state
        diagnosed = self.diagnosed_x() if (self.result / VERDICT).is_file() else {}
        return state.move(diagnosed or self.tuned_x())


def _drive_channel(reference: object, outputs: Iterable[object]) -> object:
    """Return the output at the reference itself if it was measured, else the first."""
    listed = list(outputs)
    return reference if reference in listed else listed[0]


def port_labels(layout: Layout) -> list[str]:
    """Return the labels of all points along their axes, and of all bodies in six directions."""
    axes = [f"{point}:+t{axis}" for point in layout.points for axis in "xyz"]
    return [*axes, *map(str, layout.body_dofs())]


def hash_rows(rows: Iterable[InputRow], how: str = "") -> str:
    """Return one hash of all files, and of how they are read.

    Args:
        rows: files with their hashes.
        how: keyframe and options of the command; empty for the default.
    """
    text = "".join(f"{row.file} {row.sha256}\n" for row in rows) + how
    return hashlib.sha256(text.encode()).hexdigest()
