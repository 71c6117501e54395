"""A body that is heavier or lighter than tolerance allows: a forgotten payload.

A mass m at p from the drawn centre of mass adds [[m 1, -[m p]x], [[m p]x, I]] to the spatial
inertia. All ten numbers are free, so that it may be spread; p = (m p) / m. But no body loses more
than nine tenths of its mass, nor gains several times as much: a fit that goes there has found
something else. What is added to the inertia is believed to be about as much as there is, or less:
where no hit and no sensor shows one of its six numbers, nothing else keeps the whole positive.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from diagnosis.effects.scales import MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from mbmodel import AddedPart, Change, Parameter

_MIN_SHARE = -0.9  # of the body's own mass, or moment of inertia about an axis
_MAX_SHARE, _MAX_SPREAD = (
    3.0,
    10.0,
)  # of its mass, also at the radius of gyration; of that radius squared
_INERTIA_SIGMA = 1.0  # of its mass at that radius: one standard deviation of inertia
_AXIS_NAMES = "xyz"
_ADDED_INERTIA_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each body."""
    machine = scene.model.machine
    bodies = machine.layout.bodies
    for number, body in enumerate(bodies):
        inertia = machine.body_mass[6 * number : 6 * number + 6, 6 * number : 6 * number + 6]
        if not (inertia[0, 0] > 0 and np.trace(inertia[3:, 3:]) > 0):
            continue  # a point, or the coordinate of a body's mode: it has no radius of gyration
        mass = MASS_SHARE_UNIT * float(inertia[0, 0])
        arm = float(np.sqrt(np.trace(inertia[3:, 3:]) / inertia[0, 0]))
        frame = np.zeros((6 * len(bodies), 6))
        frame[6 * number : 6 * number + 6] = np.eye(6)
        core = np.zeros((10, 3, 6, 6))
        core[0, 2, :3, :3] = mass * np.eye(3)
        for k, unit in enumerate(np.eye(3)):
            turned = mass * arm * np.cross(np.eye(3), unit)  # [e_k]x
            core[1 + k, 2, :3, 3:] = -turned
            core[1 + k, 2, 3:, :3] = turned
        for k, (i, j) in enumerate(_ADDED_INERTIA_ENTRIES):
            core[4 + k, 2, 3 + i, 3 + j] = core[4 + k, 2, 3 + j, 3 + i] = mass * arm**2
        names = (
            f"{body}.added_mass",
            *(f"{body}.added_moment_{axis}" for axis in _AXIS_NAMES),
            *(
                f"{body}.added_inertia_{_AXIS_NAMES[i]}{_AXIS_NAMES[j]}"
                for i, j in _ADDED_INERTIA_ENTRIES
            ),
        )
        parameters = tuple(Parameter(name, 0.0, f"{mass:g} kg", positive=False) for name in names)
        relative_inertia = np.diag(inertia[3:, 3:]) / (inertia[0, 0] * arm**2)
        ends = [(_MIN_SHARE, _MAX_SHARE), *[(-_MAX_SHARE, _MAX_SHARE)] * 3]
        ends += [
            (_MIN_SHARE * relative_inertia[i] if i == j else -_MAX_SPREAD, _MAX_SPREAD)
            for i, j in _ADDED_INERTIA_ENTRIES
        ]
        bounds = {
            n: (low / MASS_SHARE_UNIT, high / MASS_SHARE_UNIT)
            for n, (low, high) in zip(names, ends, strict=True)
        }
        part = AddedPart.linear(f"body:{body}", parameters, (Change("body", frame, frame, core),))
        part = replace(part, weighs=partial(np.tensordot, b=core[:, 2], axes=1))

        def state(
            fitted: Mapping[str, float],
            moved: tuple[str, ...] = names[:4],
            unit_mass: float = mass,
            lever: float = arm,
        ) -> dict[str, Value]:
            size = fitted[moved[0]]
            if not size:
                return {"mass": 0.0}
            place = tuple(lever * fitted[name] / size for name in moved[1:])
            return {"mass": unit_mass * size, "position": place}

        yield Hypothesis(
            "mass_error",
            f"body:{body}",
            parts=(part,),
            bounds=bounds,
            believed=dict.fromkeys(names[4:], _INERTIA_SIGMA / MASS_SHARE_UNIT),
            state=state,
        )


EFFECT = Effect(
    propose,
    noun="mass beyond tolerance",
    means="{place} has mass beyond tolerance: a payload or part that the drawing lacks",
    confirm="weigh {place}, or add a known mass there and repeat",
)
