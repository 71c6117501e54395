"""The nominal model of a machine, read from MJCF."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Frf, Quantity, Real, parse_quantity, shorten_names
from mbmodel import (
    Machine,
    Model,
    Modes,
    Reading,
    TimeResponse,
    as_drawn,
    linearise,
    load_machine,
    model_modes,
    simulate,
    state_space,
)
from mbmodel.simulation.drives import parse_drive, parse_reading
from mbworkbench.labels import (
    AnyLabel,
    AnyPath,
    as_labels,
    as_path,
    parse_request,
)
from mbworkbench.tables import Shown, Table

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class ModelModes(Shown):
    """Modes of a model: natural frequencies and damping ratios, with their shapes.

    Attributes:
        modes: poles [rad/s] and shapes.
    """

    modes: Modes

    @property
    def freq_hz(self) -> Real:
        """Natural frequencies [Hz]; (n_mode,)."""
        return self.modes.freq_hz

    @property
    def damping(self) -> Real:
        """Damping ratios; (n_mode,)."""
        return self.modes.damping

    def __repr__(self) -> str:
        """Return the number of modes and their frequencies in one line."""
        listed = shorten_names([f"{value:.4g}" for value in self.freq_hz])
        return f"{len(self.freq_hz)} modes at {listed} Hz"

    def table(self) -> Table:
        """Return a table of the modes."""
        rows = [
            (number, float(freq), 100 * float(damping))
            for number, (freq, damping) in enumerate(
                zip(self.freq_hz, self.damping, strict=True), start=1
            )
        ]
        return Table("Modes of the model", ("mode", "frequency [Hz]", "damping [%]"), rows)


@dataclass(frozen=True, eq=False)
class MachineModel(Shown):
    """A multi-body model at its static equilibrium, with the nominal values of its MJCF.

    Attributes:
        machine: bodies, joints, points and the matrices of the equation of motion.
    """

    machine: Machine

    @property
    def nominal(self) -> Model:
        """The model whose springs and dampers have their nominal values."""
        return as_drawn(self.machine)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.machine.layout.bodies

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the sensor and hammer points."""
        return self.machine.layout.points

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the joint coordinates."""
        return self.machine.coordinates

    def frf(
        self,
        outputs: AnyLabel | Iterable[AnyLabel],
        inputs: AnyLabel | Iterable[AnyLabel],
        freq_hz: Sequence[float] | Real,
        quantity: Quantity | None = None,
    ) -> Frf:
        """Compute frequency response functions.

        Args:
            outputs: labels of motions, such as ``acc11:+tx`` or ``hexapod:+rz``.
            inputs: labels of forces, ``floor:+tx`` for motions of the floor, or motors by name.
            freq_hz: frequencies [Hz], increasing; (n_freq,).
            quantity: receptance, mobility or accelerance; None for the receptance where all outputs
                are joints or sensors by name, as encoders read it, else the accelerance.

        Returns:
            FRFs; ``frf["acc11:+tx", "acc11:+ty"]`` is the curve of one output and input.

        Raises:
            UsageError: a label that the machine does not have.
        """
        request = parse_request(self.machine, outputs, inputs, freq_hz, quantity)
        model = self.nominal
        return linearise(model, model.drawn, request).frf()

    def modes(self) -> ModelModes:
        """Compute natural frequencies, damping ratios and mode shapes."""
        model = self.nominal
        return ModelModes(model_modes(model, model.drawn))

    def state_space(
        self,
        outputs: AnyLabel | Iterable[AnyLabel],
        inputs: AnyLabel | Iterable[AnyLabel],
        quantity: Quantity = "receptance",
    ) -> "control.StateSpace":
        """Return the linear model as a state space of python-control with named signals.

        Args:
            outputs: labels of motions.
            inputs: labels of forces or motions of the floor, or motors by name.
            quantity: of the outputs: receptance, mobility or accelerance.

        Raises:
            UsageError: a label that the machine does not have.
        """
        model = self.nominal
        request = parse_request(self.machine, outputs, inputs, (1.0,), quantity)
        return state_space(model, model.drawn, request)

    def simulate(  # one for each thing that a simulation needs
        self,
        outputs: AnyLabel | Iterable[AnyLabel],
        inputs: AnyLabel | Iterable[AnyLabel],
        time_s: Real,
        signals: Real,
        quantity: Quantity = "accelerance",
        spin: Mapping[str, float] | None = None,
    ) -> TimeResponse:
        """Simulate the motion in time from static equilibrium, nonlinear joints included.

        Args:
            outputs: labels of motions, or joints such as ``joint:ty_ty``.
            inputs: labels of forces, ``floor:+tx``, joints, or motors by name.
            time_s: evenly spaced [s]; (n_time,).
            signals: of the inputs; (n_time, n_in), or (n_time,) of one input.
            quantity: of the outputs: receptance, mobility or accelerance.
            spin: rates of hinges that turn steadily [rad/s], by name of the joint.

        Returns:
            The motion, ``outputs`` (n_time, n_out), with the step and its estimated error.

        Raises:
            UsageError: a label that the machine does not have, or shapes that do not fit.
            ConvergenceError: the motion grows without bound.
        """
        values = np.asarray(signals, float)
        return simulate(
            self.machine,
            tuple(parse_drive(self.machine, str(label)) for label in as_labels(inputs)),
            tuple(parse_reading(self.machine, str(label)) for label in as_labels(outputs)),
            time_s,
            values[:, None] if values.ndim == 1 else values,
            quantity=parse_quantity(quantity),
            spin=spin,
        )

    def __repr__(self) -> str:
        """Return a summary of at most ten lines."""
        return "\n".join(
            (
                f"model {self.machine.name}: {len(self.bodies)} bodies, "
                f"{len(self.coordinates)} coordinates, {len(self.points)} points",
                f"  bodies: {shorten_names(self.bodies)}",
                f"  coordinates: {shorten_names(self.coordinates)}",
                f"  points: {shorten_names(self.points)}",
            )
        )

    def table(self) -> Table:
        """Return a table of the bodies."""
        layout = self.machine.layout
        rows = [
            (body, *(float(value) for value in centre), int(np.sum(layout.body_of == number)))
            for number, (body, centre) in enumerate(zip(layout.bodies, layout.centres, strict=True))
        ]
        header = ("body", "x [m]", "y [m]", "z [m]", "points")
        return Table(repr(self).splitlines()[0], header, rows)


def read_model(
    path: AnyPath,
    spin: Mapping[str, float] | None = None,
    key: str | None = None,
    *,
    without: Sequence[str] = (),
    soft_equalities: bool = False,
) -> MachineModel:
    """Read a machine from MJCF and linearise it at its static equilibrium.

    Args:
        path: the MJCF.
        spin: rates of hinges that turn steadily [rad/s], by name of the joint.
        key: name of the keyframe that gives the pose and the controls, empty for none; by default
            the keyframe ``home`` if there is one, else none.
        without: what is left out of the file: ``contact``, ``friction``, ``limits``.
        soft_equalities: whether equality constraints are soft as in MuJoCo, instead of rigid.

    Raises:
        InputError: the file cannot be read or the machine cannot be linearised.
        UsageError: there is nothing of a name that is left out.
    """
    reading = Reading(tuple(without), soft_equalities)
    return MachineModel(load_machine(as_path(path), spin, key, reading=reading))
