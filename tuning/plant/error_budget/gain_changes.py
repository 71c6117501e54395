r"""How the gain that a mode allows changes with the machine.

With the gain g at which |1 + g L| reaches the margin at the line that limits it, a change dL of the
loop's gain at this line changes g by

    dg = -Re((1 + g conj(L)) dL) g / (Re(L) + g |L|^2).

By the envelope theorem the change of the line itself is of second order. dL is the FRF's derivative
by a parameter. For a sensor that reads n' u at a point, and a point that moves by d, it is
d' (n x turn), with the turn of its body; for a force it is that of the moment d x n.

A strut of stiffness k along e between two points adds k h h' to the stiffness, with h' q the
elongation e' (u_b - u_a). The FRF from the force to the sensor changes by -k H_sh H_hf, h being
the elongation or a pair of forces along it. With the shape phi of unit modal mass, a strut whose
k (h' phi)^2 is a tenth of w^2 brings a tenth of the strain energy of a mode.
"""

from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from identification.words import Complex, Dof, Loop, Port, PortSum, Real, first_by_key
from mbmodel import Evaluator, FrfRequest, Machine, Model, Part, body_parts, joint_parts
from tuning.plant.error_budget.definition import Source
from tuning.plant.error_budget.loop_algebra import close_loops, map_ports
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.plant_budget import STEP_OF_A_TOUCH

_MOVE_M = 0.01  # of a sensor or force
_MIN_CHANGE = 1e-4  # of a gain, that is listed
_LISTED_STRUTS = 3  # of each mode, one for each pair of bodies
_MIN_STRUT_M = 1e-6  # of two points that lie apart


class GainLimit(NamedTuple):
    """A line at which a mode limits the gain of a loop.

    Args:
        freq_hz: the line [Hz].
        loop_gain: L there.
        gain: g.
        mode_hz: frequency of the mode [Hz].
        shape: of the mode, of unit modal mass; (nv,).
    """

    freq_hz: float
    loop_gain: complex
    gain: float
    mode_hz: float
    shape: Complex


def gain_changes(plant: LoopPlant, loop: Loop, limit: GainLimit) -> dict[str, float]:
    """Return the relative change of an allowed gain for each change of the machine, by its name.

    Changes are 10 % more of a stiffness, damping or mass, a sensor or a force of the loop that is
    moved by 10 mm along a world axis, its direction kept, and the struts between points of two
    bodies, or from a point to the ground, that raise the gain most. Of all struts the one that a
    mode strains most adds 10 % to its strain energy, and the others have its stiffness. How a
    spring changes the images of a sampled loop is left out.

    Args:
        limit: where the mode allows no more.
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
    ends = [Dof.of(point, axis) for point in machine.layout.points for axis in range(3)]
    inputs = (loop.input, *moments, *ends)
    definition = replace(
        plant.definition,
        errors=(loop.measured, *turns, *(PortSum("end", ((port, 1.0),), "m") for port in ends)),
        sources=tuple(Source("force", ((port, 1.0 + 0j),)) for port in inputs),
        loops=tuple(each for each in plant.definition.loops if each is not loop),
        coherence=np.eye(len(inputs), dtype=complex),
    )
    ports = map_ports(definition)
    request = FrfRequest(np.array([limit.freq_hz]), ports.outputs, ports.inputs, "receptance")
    lines = Evaluator(whole, request).at(whole.drawn)
    response = close_loops(definition, ports, lines.values, request.laplace)
    law = loop.controller.response(request.laplace) * np.exp(-request.laplace * loop.delay)
    loop_gain, gain = limit.loop_gain, limit.gain
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
    reach = response.errors[0]
    turned = reach[1 : 1 + len(turns), 0].reshape(len(sensors), 3)
    moved = [
        (place, place.weight * np.cross(place.direction, turn))
        for place, turn in zip(sensors, turned, strict=True)
    ]
    if force:
        moved.append((force, np.cross(force.direction, reach[0, 1:4])))
    for place, slopes in moved:
        for axis, name in enumerate("xyz"):
            change = float(np.expm1(_MOVE_M * (factor * slopes[axis]).real))
            label = f"{place.point} moved by {1e3 * _MOVE_M:g} mm along {name}"
            changes[label] = changes.get(label, 0.0) + change
    struts = _Struts.of(machine)
    stretch = struts.elongations(machine.layout.rows(ends) @ machine.jacobian @ limit.shape)
    if (largest := float(np.abs(stretch).max(initial=0.0))) > 0:
        stiffness = float(f"{STEP_OF_A_TOUCH * (2 * np.pi * limit.mode_hz / largest) ** 2:.2g}")
        read = struts.elongations(reach[0, 1 + len(moments) :])
        driven = struts.elongations(reach[1 + len(turns) :, 0])
        gains = np.expm1(-stiffness * (factor * read * driven).real)
        ranked = np.argsort(-gains, kind="stable").tolist()
        best = first_by_key((struts.bodies[k], k) for k in ranked)  # of each pair of bodies
        for k in list(best.values())[:_LISTED_STRUTS]:
            changes[f"a strut of {stiffness:g} N/m {struts.names[k]}"] = max(float(gains[k]), 0.0)
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


class _Struts(NamedTuple):
    """Struts between points of two bodies, or from a point to the ground along a world axis.

    Args:
        names: between what each stands.
        bodies: numbers of its two bodies; -1 for the ground.
        rows: elongation per motion of the points along their axes; (n_strut, 3 n_point).
    """

    names: list[str]
    bodies: list[tuple[int, int]]
    rows: Real

    @classmethod
    def of(cls, machine: Machine) -> "_Struts":
        """Return all struts of a machine."""
        layout, count = machine.layout, len(machine.layout.points)
        names, bodies, rows = list[str](), list[tuple[int, int]](), list[Real]()
        for first, second in combinations(range(count), 2):
            along = layout.positions[second] - layout.positions[first]
            length = float(np.linalg.norm(along))
            if layout.body_of[first] != layout.body_of[second] and length > _MIN_STRUT_M:
                row = np.zeros((count, 3))
                row[first] = -along @ layout.axes[first] / length
                row[second] = along @ layout.axes[second] / length
                names.append(f"between {layout.points[first]} and {layout.points[second]}")
                low, high = sorted(layout.body_of[[first, second]].tolist())
                bodies.append((low, high))
                rows.append(row.ravel())
        for number, point in enumerate(layout.points):
            for axis, name in enumerate("xyz"):
                row = np.zeros((count, 3))
                row[number] = layout.axes[number][axis]
                names.append(f"from {point} to the ground along {name}")
                bodies.append((-1, int(layout.body_of[number])))
                rows.append(row.ravel())
        return cls(names, bodies, np.array(rows).reshape(-1, 3 * count))

    def elongations(self, motions: Complex) -> Complex:
        """Return the elongation of each strut for motions of the points; (n_strut,)."""
        return np.asarray(self.rows @ motions, np.complex128)
