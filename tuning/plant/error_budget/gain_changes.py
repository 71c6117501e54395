r"""How the gain that a mode allows changes with the machine.

With the gain g at which |1 + g L| reaches the margin at the line that limits it, a change dL of the
loop's gain at this line changes g by

    dg = -Re((1 + g conj(L)) dL) g / (Re(L) + g |L|^2).

By the envelope theorem the change of the line itself is of second order. dL is the FRF's derivative
by a parameter. For a sensor that reads n' u at a point, and a point that moves by d, it is
d' (n x turn), with the turn of its body; for a force it is that of the moment d x n.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification.words import Dof, Loop, Port, PortSum, Real
from mbmodel import Evaluator, FrfRequest, Machine, Model, Part, body_parts, joint_parts
from tuning.plant.error_budget.definition import Source
from tuning.plant.error_budget.loop_algebra import close_loops, map_ports
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.plant_budget import STEP_OF_A_TOUCH

_MOVE_M = 0.01  # of a sensor or force
_MIN_CHANGE = 1e-4  # of a gain, that is listed


def gain_changes(
    plant: LoopPlant, loop: Loop, freq_hz: float, loop_gain: complex, gain: float
) -> dict[str, float]:
    """Return the relative change of an allowed gain for each change of the machine, by its name.

    Changes are 10 % more of a stiffness, damping or mass, and a sensor or a force of the loop that
    is moved by 10 mm along a world axis, its direction kept. How a spring changes the images of a
    sampled loop is left out.

    Args:
        loop: of the gain.
        freq_hz: line where it is reached [Hz].
        loop_gain: L there.
        gain: g.
    """
    machine = plant.model.machine
    known = {parameter.name for parameter in plant.model.parameters}
    candidates: list[Part] = [*body_parts(machine), *joint_parts(machine)]
    further = [
        part for part in candidates if not known & {parameter.name for parameter in part.parameters}
    ]
    whole = Model(machine, (*plant.model.parts, *further))
    places = [_place(machine, port, weight) for port, weight in loop.measured.terms]
    sensors = [place for place in places if place is not None]
    force = _place(machine, loop.input, 1.0)
    order = loop.measured.derivative
    turns = [
        PortSum("turn", ((Dof.of(place.body, axis), 1.0),), "rad")
        for place in sensors
        for axis in (3, 4, 5)
    ]
    moments = [Dof.of(force.body, axis) for axis in (3, 4, 5)] if force else []
    definition = replace(
        plant.definition,
        errors=(loop.measured, *turns),
        sources=tuple(Source("force", ((port, 1.0 + 0j),)) for port in (loop.input, *moments)),
        loops=tuple(each for each in plant.definition.loops if each is not loop),
        coherence=np.eye(1 + len(moments), dtype=complex),
    )
    ports = map_ports(definition)
    request = FrfRequest(np.array([freq_hz]), ports.outputs, ports.inputs, "receptance")
    lines = Evaluator(whole, request).at(whole.drawn)
    response = close_loops(definition, ports, lines.values, request.laplace)
    law = loop.controller.response(request.laplace) * np.exp(-request.laplace * loop.delay)
    slope = loop_gain.real + gain * abs(loop_gain) ** 2
    factor = -(1 + gain * loop_gain.conjugate()) / slope * law[0] * request.laplace[0] ** order
    outer = response.left[:, 0, :, None] * response.right[:, None, :, 0]
    relative = lines.gradient(np.asarray((factor * outer).conj())) * whole.drawn
    changes = {
        f"{STEP_OF_A_TOUCH:.0%} more of {parameter.name}".replace("%", " %"): float(
            (1 + STEP_OF_A_TOUCH) ** value - 1
        )
        for parameter, value in zip(whole.parameters, relative, strict=True)
        if value and parameter.name.endswith((".stiffness", ".damping", ".mass"))
    }
    turned = response.errors[0, 1:, 0].reshape(len(sensors), 3)
    moved = [
        (place, place.weight * np.cross(place.direction, turn))
        for place, turn in zip(sensors, turned, strict=True)
    ]
    if force:
        moved.append((force, np.cross(force.direction, response.errors[0, 0, 1:])))
    for place, slopes in moved:
        for axis, name in enumerate("xyz"):
            change = float(np.expm1(_MOVE_M * (factor * slopes[axis]).real))
            label = f"{place.point} moved by {1e3 * _MOVE_M:g} mm along {name}"
            changes[label] = changes.get(label, 0.0) + change
    changes = {name: change for name, change in changes.items() if abs(change) > _MIN_CHANGE}
    return dict(sorted(changes.items(), key=lambda pair: -abs(pair[1])))


class _Place(NamedTuple):
    """Point of a sensor or force along a direction in world axes, with its weight in the loop."""

    point: str
    body: str
    direction: Real
    weight: float


def _place(machine: Machine, port: Port, weight: float) -> _Place | None:
    """Return the place of a port along an axis of a drawn point; None for other ports."""
    layout = machine.layout
    if not isinstance(port, Dof) or port.is_rotation or port.point not in layout.points:
        return None
    axes = layout.axes[layout.points.index(port.point)]
    return _Place(port.point, layout.body_name(port.point), port.sign * axes[:, port.axis], weight)
