"""A body that is heavier or lighter than its tolerance allows: a forgotten payload.

A mass m at p from the drawn centre of mass adds [[m 1, -[m p]x], [[m p]x, I]] to the spatial
inertia. All ten numbers vary, so that the mass may be distributed; p = (m p) / m. Bounds keep the
mass positive, at most four times the drawn one, and within three radii of gyration. The prior of
the six numbers of I has a standard deviation of the mass at the radius of gyration: if no hit and
no sensor shows one of them, nothing but the prior keeps the whole inertia positive.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from diagnosis.effects.points import name_vector
from diagnosis.effects.scales import MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from diagnosis.movable import Movable
from diagnosis.settings import DiagnosisSettings
from identification.words import Real
from mbmodel import AddedPart, Change, Parameter, transport


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each body with mass and moment of inertia."""
    machine = scene.model.machine
    for number, body in enumerate(machine.layout.bodies):
        span = slice(6 * number, 6 * number + 6)
        inertia = machine.body_mass[span, span]
        if not (inertia[0, 0] > 0 and np.trace(inertia[3:, 3:]) > 0):
            continue  # a point, or the coordinate of a body's mode: it has no radius of gyration
        unit = MASS_SHARE_UNIT * float(inertia[0, 0])
        gyration = float(np.sqrt(np.trace(inertia[3:, 3:]) / inertia[0, 0]))
        rows, columns = np.triu_indices(3)
        moved = (f"{body}.added_mass", *name_vector(f"{body}.added_moment_"))
        axes = [f"{'xyz'[i]}{'xyz'[j]}" for i, j in zip(rows, columns, strict=True)]
        spread = tuple(f"{body}.added_inertia_{entry}" for entry in axes)
        names = (*moved, *spread)
        parameters = tuple(Parameter(name, 0.0, f"{unit:g} kg", positive=False) for name in names)
        frame = np.eye(len(machine.body_mass))[:, span]
        core = _build_core(unit, gyration)
        part = AddedPart.linear(f"body:{body}", parameters, (Change("body", frame, frame, core),))
        yield Hypothesis(
            "mass_error",
            f"body:{body}",
            parts=(replace(part, weighs=partial(np.tensordot, b=core[:, 2], axes=1)),),
            bounds=dict(zip(names, _find_bounds(scene.settings, inertia, gyration), strict=True)),
            believed=dict.fromkeys(spread, 1 / MASS_SHARE_UNIT),
            movable=_build_movable(body, names, core[:, 2], machine.layout.centres[number]),
            state=partial(_state_mass, moved, unit, gyration),
        )


def _build_core(unit: float, gyration: float) -> Real:
    """Return the spatial inertia per unit of mass, moments and upper triangle; (10, 3, 6, 6)."""
    core = np.zeros((10, 3, 6, 6))
    core[0, 2, :3, :3] = unit * np.eye(3)
    for k, direction in enumerate(np.eye(3)):
        turned = unit * gyration * np.cross(np.eye(3), direction)  # [direction]x
        core[1 + k, 2, :3, 3:] = -turned
        core[1 + k, 2, 3:, :3] = turned
    for k, (i, j) in enumerate(zip(*np.triu_indices(3), strict=True)):
        core[4 + k, 2, 3 + i, 3 + j] = core[4 + k, 2, 3 + j, 3 + i] = unit * gyration**2
    return core


def _build_movable(body: str, names: Sequence[str], core: Real, centre: Real) -> Movable:
    """Return how the mass is carried to other bodies: as its spatial inertia at the origin.

    Args:
        body: the body.
        names: names of the parameters.
        core: spatial inertia at the centre of mass per parameter; (10, 6, 6).
        centre: drawn centre of mass [m]; (3,).
    """

    def read(fitted: Mapping[str, float]) -> dict[str, Real]:
        to_centre = transport(centre)
        inertia = np.tensordot([fitted[name] for name in names], core, axes=1)
        return {"inertia": to_centre.T @ inertia @ to_centre}

    def start(values: Mapping[str, Real]) -> dict[str, float]:
        to_origin = transport(-centre)
        inertia = to_origin.T @ values["inertia"] @ to_origin
        theta = np.linalg.lstsq(core.reshape(len(names), -1).T, inertia.ravel())[0]
        return dict(zip(names, theta.tolist(), strict=True))

    return Movable((body,), read, start)


def _find_bounds(
    settings: DiagnosisSettings, inertia: Real, gyration: float
) -> list[tuple[float, float]]:
    """Return the bounds of mass, moments and upper triangle, in their units."""
    relative = np.diag(inertia[3:, 3:]) / (inertia[0, 0] * gyration**2)
    most = settings.max_added_mass_share
    least = -most / (1 + most)  # the drawn mass is too large by as much as it may be too small
    ends = [(least, most), *[(-most, most)] * 3]
    for i, j in zip(*np.triu_indices(3), strict=True):
        ends.append((least * float(relative[i]) if i == j else -(most**2), most**2))
    return [(low / MASS_SHARE_UNIT, high / MASS_SHARE_UNIT) for low, high in ends]


def _state_mass(
    names: tuple[str, ...], unit: float, gyration: float, fitted: Mapping[str, float]
) -> dict[str, Value]:
    """Return the mass [kg] and its position [m]."""
    size = fitted[names[0]]
    if not size:
        return {"mass": 0.0}
    place = tuple(gyration * fitted[name] / size for name in names[1:])
    return {"mass": unit * size, "position": place}


EFFECT = Effect(
    propose,
    noun="mass beyond tolerance",
    means="{place} has mass beyond tolerance: a payload or part that the drawing lacks",
    confirm="weigh {place}, or add a known mass there and repeat",
)
