r"""A machine over a grid of poses and spin rates: modes, FRFs, state spaces and margins at each.

At each point the machine is linearised anew, with the moved springs at rest there. Modes are
followed from one point to the next by the largest sum of |phi_a^H M phi_b|^2, which is 1 for equal
shapes of unit modal mass. State spaces have the joint coordinates and their rates as states, in one
order at all points, so that a gain schedule may interpolate their matrices.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from identification.words import Complex, InputError, Quantity, Real
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    as_drawn,
    export_state_space,
    load_machine,
    model_modes,
    parse_input,
    parse_output,
    usual_quantity,
)
from tuning.control_loops.stability import growing_pole
from tuning.plant.control_loops.stability_margins import AllMargins
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.read_definition import read_definition

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class GridPoint:
    """A pose and the spin of a machine.

    Args:
        pose: moves of slides and hinges from the drawing [m, rad], by name.
        spin: rates of hinges that turn steadily [rad/s], by name.
    """

    pose: Mapping[str, float]
    spin: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the moves and rates in words."""
        moves = [f"{name} = {value:g}" for name, value in self.pose.items()]
        rates = [f"{name} at {value:g} rad/s" for name, value in self.spin.items()]
        return ", ".join([*moves, *rates]) or "as drawn"


@dataclass(frozen=True)
class GridRequest:
    """What is computed at each point.

    Args:
        outputs, inputs: labels of FRFs and state spaces; empty for none.
        freq_hz: lines [Hz]; (n_freq,).
        quantity: of the outputs; None for the usual one of the outputs.
        budget: budget.toml whose loops have margins; None for none.
    """

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    freq_hz: Real = field(default_factory=lambda: np.ones(1))
    quantity: Quantity | None = None
    budget: Path | None = None


@dataclass(frozen=True, eq=False)
class PoseGrid:
    """A machine over a grid of poses.

    Args:
        points: n_point.
        poles: of the modes that oscillate, each followed over the grid [rad/s]; NaN where it has no
            counterpart; (n_point, n_mode).
        frfs: (n_point, n_freq, n_out, n_in).
        systems: A, B, C, D of each point; empty without ports.
        state_labels: of the states.
        loops: names of the loops.
        margins: at each point; None where the loops are unstable, empty without loops.
        growing: pole that grows fastest with the loops closed [rad/s]; None if none does.
        request: what was computed.
    """

    points: tuple[GridPoint, ...]
    poles: Complex
    frfs: Complex
    systems: tuple[tuple[Real, Real, Real, Real], ...]
    state_labels: tuple[str, ...]
    loops: tuple[str, ...]
    margins: tuple[AllMargins | None, ...]
    growing: tuple[complex | None, ...]
    request: GridRequest

    def __repr__(self) -> str:
        """Return the size of the grid and its worst point in one line."""
        return f"{len(self.points)} points, worst at {self.points[self.worst]}"

    def to_control(self) -> list["control.StateSpace"]:
        """Return the state space of each point for python-control, with names of signals."""
        import control  # noqa: PLC0415  # with its matplotlib it would add 0.7 s to every start

        names = {"inputs": self.request.inputs, "outputs": self.request.outputs}
        return [control.ss(*each, **names, states=self.state_labels) for each in self.systems]

    @property
    def freq_hz(self) -> Real:
        """Natural frequencies of the modes [Hz]; (n_point, n_mode)."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def modulus(self) -> Real:
        """Smallest modulus margin of any loop at each point; 0 where they are unstable."""
        return np.array(
            [
                0.0 if each is None else min(loop.modulus.value for loop in each.loops)
                for each in self.margins
            ]
        )

    @property
    def worst(self) -> int:
        """Number of the point with the smallest margin, of the fastest growth if some grow.

        Without loops it is the point whose modes lie farthest from those of the grid's median.
        """
        if not self.margins:
            middle = np.nanmedian(self.freq_hz, axis=0)
            return int(np.nanargmax(np.nanmax(np.abs(np.log(self.freq_hz / middle)), axis=1)))
        growth = [0.0 if pole is None else pole.real for pole in self.growing]
        return int(np.argmax(growth)) if any(growth) else int(np.argmin(self.modulus))


def pose_grid(
    path: Path, points: Sequence[GridPoint], request: GridRequest, key: str | None = None
) -> PoseGrid:
    """Compute a machine over a grid of poses and spin rates.

    Args:
        path: MJCF of the machine.
        points: of the grid, neighbours beside each other.
        request: what is computed.
        key: keyframe from which the poses move; None for ``home`` if there is one.

    Raises:
        InputError: a pose that the machine does not have or cannot rest in.
        UsageError: a label or hinge that the machine does not have.
    """
    models, growing, margins = [], list[complex | None](), list[AllMargins | None]()
    loops: tuple[str, ...] = ()
    for point in points:
        machine = load_machine(path, point.spin, key, pose=point.pose)
        model = as_drawn(machine)
        models.append(model)
        if request.budget is None:
            continue
        definition = read_definition(request.budget, machine, loops_suffice=True)
        if not definition.loops:
            raise InputError(f"{request.budget} has no loop, and so no margins: add [loop.NAME]")
        loops = tuple(loop.name for loop in definition.loops)
        plant = LoopPlant.of(model, definition)
        closed = plant.poles(model.drawn, is_closed=True)
        growing.append(growing_pole(closed))
        open_poles = plant.poles(model.drawn, is_closed=False)
        is_stable = growing[-1] is None
        margins.append(plant.margins(model.drawn, open_poles, closed) if is_stable else None)
    frfs, systems, labels = _between_ports(models, request)
    return PoseGrid(
        tuple(points),
        follow_modes(models),
        frfs,
        systems,
        labels,
        loops,
        tuple(margins),
        tuple(growing),
        request,
    )


def _between_ports(
    models: Sequence[Model], request: GridRequest
) -> tuple[Complex, tuple[tuple[Real, Real, Real, Real], ...], tuple[str, ...]]:
    """Return FRFs and state spaces at the points, and the labels of the states."""
    frfs, systems, labels = [], [], list[str]()
    for model in models if request.outputs and request.inputs else ():
        outputs = tuple(parse_output(model.machine, text) for text in request.outputs)
        inputs = tuple(parse_input(model.machine, text) for text in request.inputs)
        quantity = request.quantity or usual_quantity(outputs)
        ports = FrfRequest(request.freq_hz, outputs, inputs, quantity)
        frfs.append(Evaluator(model, ports).at(model.drawn).values)
        system = export_state_space(model, model.drawn, ports).system
        systems.append((system.A, system.B, system.C, system.D))
        labels = list(system.state_labels)
    shape = len(models), 0, len(request.outputs), len(request.inputs)
    return np.array(frfs) if frfs else np.zeros(shape, complex), tuple(systems), tuple(labels)


def follow_modes(models: Sequence[Model]) -> Complex:
    """Return the poles of the oscillating modes of models, each mode in one column [rad/s].

    Args:
        models: of one machine at neighbouring points.

    Returns:
        NaN where a mode has no counterpart; (n_model, n_mode).
    """
    columns, rows = list[Complex](), list[Complex]()  # shapes as last seen, and poles at each model
    for model in models:
        modes = model_modes(model, model.drawn)
        shapes, poles = (each[..., modes.oscillates].T for each in (modes.shapes, modes.poles))
        numbers = np.full(len(columns), -1)
        if columns:
            mass = model.matrices(model.drawn).mass
            alike = np.abs(np.array(columns).conj() @ mass @ shapes.T) ** 2
            seen, chosen = linear_sum_assignment(alike, maximize=True)
            numbers[seen] = chosen
        new = [k for k in range(len(poles)) if k not in numbers]
        numbers = np.append(numbers, new).astype(int)
        columns = [shapes[k] if k >= 0 else columns[column] for column, k in enumerate(numbers)]
        rows.append(np.where(numbers >= 0, poles[numbers], np.nan))
    table = np.full((len(models), len(columns)), np.nan, complex)
    for number, row in enumerate(rows):
        table[number, : len(row)] = row
    return table
