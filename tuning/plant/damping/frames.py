r"""Frames of a platform on struts: Jacobian, centre of stiffness, and coupling in each frame.

With the base at rest, a small motion x of the platform at a point p, (v, w), stretches the struts
by e = J x; forces f of the struts are the wrench J' f there. Let H be the receptance from strut
forces to elongations. Controlled in the frame at p, the plant is

    G = J^-1 H J^-T

The coupling of G is the largest |G_ij| / sqrt(|G_ii G_jj|) of two directions. In a frame at the
centre of mass it vanishes at high frequency where the inertia is diagonal there, in one at the
centre of stiffness at low frequency where the stiffness J' k J is.

Struts of a machine: tendons or joints with a spring, along which an actuator pushes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from identification.words import Complex, Real, UsageError, shorten_names
from mbmodel import Model, SpringPart, parent_bodies, transport


@dataclass(frozen=True, eq=False)
class Struts:
    """Struts in parallel with their actuators, each in series with a force sensor.

    Args:
        names: of the tendons or joints; n_strut.
        elongation: G, each strut's elongation per joint coordinate; (nv, n_strut).
        stiffness: k of each [N/m]; (n_strut,).
        damping: c of each [N s/m]; (n_strut,).
    """

    names: tuple[str, ...]
    elongation: Real
    stiffness: Real
    damping: Real

    def select(self, chosen: Sequence[int]) -> "Struts":
        """Return some of the struts.

        Args:
            chosen: their numbers.
        """
        numbers = list(chosen)
        return Struts(
            tuple(self.names[k] for k in numbers),
            self.elongation[:, numbers],
            self.stiffness[numbers],
            self.damping[numbers],
        )


def find_struts(model: Model, theta: Real, patterns: Sequence[str]) -> Struts:
    """Return the struts whose names match, in the order of the model.

    Args:
        theta: parameters in SI; (n_parameter,).
        patterns: names of tendons or joints; ``*`` stands for any text.

    Raises:
        UsageError: a pattern without a spring of stiffness.
    """
    jacobian = model.assemble(theta).jacobian
    rows = [
        row
        for part, values in zip(model.parts, model.split_parameters(theta), strict=True)
        if isinstance(part, SpringPart)
        for row in part.rows(values, jacobian)
        if row[2] > 0
    ]
    for pattern in patterns:
        if not any(fnmatchcase(spring.name, pattern) for spring, *_ in rows):
            known = shorten_names([spring.name for spring, *_ in rows])
            raise UsageError(
                f"no tendon or joint with stiffness is named {pattern!r}: choose of {known}"
            )
    chosen = [row for row in rows if any(fnmatchcase(row[0].name, pattern) for pattern in patterns)]
    return Struts(
        tuple(spring.name for spring, *_ in chosen),
        np.array([direction for _, direction, *_ in chosen]).T,
        np.array([stiffness for *_, stiffness, _ in chosen]),
        np.array([damping for *_, damping in chosen]),
    )


_MIN_STRETCH = 1e-9  # elongation per coordinate that counts, relative to the largest
_MAX_JACOBIAN_CONDITION = 1e8  # of the platform's motion per joint coordinate, lengths in m


@dataclass(frozen=True, eq=False)
class StrutFrames:
    """Frames of a platform.

    Args:
        body: name of the platform.
        centre_of_mass: of the platform with all that it carries [m]; (3,).
        centre_of_stiffness: where forces turn it least [m]; (3,).
        jacobians: J at each centre by name; (n_strut, 6) each.
        freq_hz: lines [Hz]; (n_freq,).
        coupling: largest coupling in each frame by name; (n_freq,) each.
    """

    body: str
    centre_of_mass: Real
    centre_of_stiffness: Real
    jacobians: Mapping[str, Real]
    freq_hz: Real
    coupling: Mapping[str, Real]


def strut_jacobian(model: Model, theta: Real, struts: Struts, body: str, point: Real) -> Real:
    """Return J: elongations per motion of a platform at a point, its base at rest; (n_strut, 6).

    Args:
        theta: parameters in SI; (n_parameter,).
        struts: between the platform and its base.
        body: name of the platform.
        point: p [m]; (3,).

    Raises:
        UsageError: the platform has not six free directions of its own.
    """
    machine = model.machine
    number = machine.layout.bodies.index(body)
    motion = model.assemble(theta).jacobian[6 * number : 6 * number + 6]
    moving_coordinates = _own_coordinates(model, body)
    columns = motion[:, moving_coordinates]
    if len(moving_coordinates) != 6 or np.linalg.cond(columns) > _MAX_JACOBIAN_CONDITION:
        raise UsageError(
            f"{body} has {len(moving_coordinates)} directions on its base, but a frame needs six "
            "independent ones"
        )
    per_centre = struts.elongation[moving_coordinates].T @ np.linalg.inv(columns)
    return per_centre @ transport(machine.layout.centres[number] - point)


def platform_of(model: Model, struts: Struts) -> str:
    """Return the body that the struts carry: the highest one that they move against its base.

    Raises:
        UsageError: the struts do not end at one platform.
    """
    bodies, stretch = model.machine.layout.bodies, np.abs(struts.elongation)
    moved = [
        body
        for body in bodies
        if (stretch[_own_coordinates(model, body)] > _MIN_STRETCH * stretch.max()).any()
    ]
    if len(moved) != 1:
        names = ", ".join(moved) or "no body"
        raise UsageError(f"the struts move {names}: name those between one platform and its base")
    return moved[0]


def strut_frames(model: Model, theta: Real, struts: Struts, freq_hz: Real) -> StrutFrames:
    """Return the frames of the platform on struts, and the coupling of its plant in each.

    Args:
        theta: parameters in SI; (n_parameter,).
        struts: six, between one platform and its base.
        freq_hz: lines [Hz]; (n_freq,).

    Raises:
        UsageError: other than six struts, or struts that do not hold a platform in six directions.
    """
    if len(struts.names) != 6:
        raise UsageError(f"a frame needs six struts, and {len(struts.names)} are named")
    body = platform_of(model, struts)
    mass_centre = _carried_centre(model, theta, body)
    stiffness_centre = _stiffness_centre(model, theta, struts, body, mass_centre)
    points = {"centre of mass": mass_centre, "centre of stiffness": stiffness_centre}
    jacobians = {
        name: strut_jacobian(model, theta, struts, body, point) for name, point in points.items()
    }
    plant = _strut_plant(model, theta, struts, freq_hz)
    coupling = {"struts": _largest_coupling(plant)}
    for name, jacobian in jacobians.items():
        inverse = np.linalg.inv(jacobian)
        coupling[name] = _largest_coupling(inverse @ plant @ inverse.T)
    return StrutFrames(body, mass_centre, stiffness_centre, jacobians, freq_hz, coupling)


def _own_coordinates(model: Model, body: str) -> list[int]:
    """Return the joint coordinates that move a body against its parent."""
    machine = model.machine
    parent = parent_bodies(machine)[body]
    bodies = machine.layout.bodies

    def moving(name: str) -> set[int]:
        start = 6 * bodies.index(name)
        columns = machine.jacobian[start : start + 6].any(axis=0)
        return set(np.flatnonzero(columns).tolist())

    return sorted(moving(body) - (moving(parent) if parent else set()))


def _carried_centre(model: Model, theta: Real, body: str) -> Real:
    """Return the centre of mass of a platform with all that stands on it; (3,)."""
    machine, parents = model.machine, parent_bodies(model.machine)
    inertia = model.assemble(theta).body[2]
    total, moment = 0.0, np.zeros(3)
    for number, name in enumerate(machine.layout.bodies):
        above: str | None = name
        while above is not None and above != body:
            above = parents[above]
        if above == body:
            mass = float(inertia[6 * number, 6 * number])
            total, moment = total + mass, moment + mass * machine.layout.centres[number]
    return moment / total if total else machine.layout.centres[0]


def _stiffness_centre(model: Model, theta: Real, struts: Struts, body: str, start: Real) -> Real:
    """Return the point about which the coupling of forces and rotations is least; (3,).

    A step r of the point changes the block B of forces per rotation to B + A [r x], with A the
    block of forces per translation: the least squares of all nine numbers give r.
    """
    jacobian = strut_jacobian(model, theta, struts, body, start)
    stiffness = jacobian.T @ (struts.stiffness[:, None] * jacobian)
    columns = []
    for axis in np.eye(3):
        shift = transport(axis)[:3, 3:]  # motion of the old point per rotation about the new one
        columns.append((stiffness[:3, :3] @ shift).ravel())
    step = np.linalg.lstsq(np.array(columns).T, stiffness[:3, 3:].ravel(), rcond=None)[0]
    return start + step


def _strut_plant(model: Model, theta: Real, struts: Struts, freq_hz: Real) -> Complex:
    """Return the receptance from strut forces to elongations; (n_freq, n_strut, n_strut)."""
    matrices = model.matrices(theta)
    s = 2j * np.pi * freq_hz[:, None, None]
    dynamic = s**2 * matrices.mass + s * matrices.damping + matrices.stiffness
    frame = struts.elongation.astype(complex)
    force = np.broadcast_to(frame, (len(freq_hz), *frame.shape))
    return np.asarray(struts.elongation.T @ np.linalg.solve(dynamic, force), np.complex128)


def _largest_coupling(plant: Complex) -> Real:
    """Return the largest |G_ij| / sqrt(|G_ii G_jj|); (n_freq,)."""
    diagonal = np.sqrt(np.abs(np.einsum("fii->fi", plant)))
    relative = np.abs(plant) / (diagonal[:, :, None] * diagonal[:, None, :])
    size = plant.shape[1]
    return np.where(np.eye(size, dtype=bool), 0.0, relative).max(axis=(1, 2))
