"""A rotor that spins inside a body: the moment that turns its angular momentum H acts on the body.

H turns with the body at the rate omega, dH/dt = omega x H = -H x omega. On the rotations of the
body this is Zb -= s [H]x, which is skew, so that it neither stores nor dissipates energy. With H
along z the moment about x is H omega_y. If tests state different spindle speeds, H is proportional
to them, and the H at the highest speed is stated.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from diagnosis.effects.scales import MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.movable import Movable
from diagnosis.scene_points import find_middle_frequency, name_vector
from diagnosis.stated_values import Value
from identification.words import Condition, Real
from mbmodel import AddedPart, Change, MjcfLack, NotInMjcf, Parameter


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each body with a moment of inertia."""
    machine = scene.model.machine
    omega = find_middle_frequency(scene)
    fractions = _find_fractions(
        [test.condition.spindle_speed for test in scene.session.campaign.tests]
    )
    for number, body in enumerate(machine.layout.bodies):
        rotations = slice(6 * number + 3, 6 * number + 6)
        inertia = float(np.trace(machine.body_mass[rotations, rotations])) / 3
        if not inertia > 0:
            continue  # a point, or the coordinate of a body's mode
        unit = MASS_SHARE_UNIT * inertia * omega
        frame = np.eye(len(machine.body_mass))[:, rotations]
        core = np.zeros((3, 3, 3, 3))
        for k, direction in enumerate(np.eye(3)):
            core[k, 1] = unit * np.cross(direction, np.eye(3))  # rows of -[direction]x
        names = name_vector(f"{body}.angular_momentum_")
        label = f"{unit:g} kg m^2/s"
        parameters = tuple(Parameter(name, 0.0, label, positive=False) for name in names)
        spin = Change("body", frame, frame, core)
        part = AddedPart.linear(f"body:{body}", parameters, (spin,), fractions)
        part = replace(part, written=partial(_explain_rotor, body, unit))
        yield Hypothesis(
            "gyroscopic",
            f"body:{body}",
            parts=(part,),
            movable=_build_movable(body, names, unit),
            state=partial(_state_momentum, names, unit),
        )


def _build_movable(body: str, names: tuple[str, ...], unit: float) -> Movable:
    """Return how the rotor is carried to other bodies: as its angular momentum."""

    def read(fitted: Mapping[str, float]) -> dict[str, Real]:
        return {"momentum": unit * np.array([fitted[name] for name in names])}

    def start(values: Mapping[str, Real]) -> dict[str, float]:
        return dict(zip(names, (values["momentum"] / unit).tolist(), strict=True))

    return Movable((body,), read, start)


def _state_momentum(
    names: tuple[str, ...], unit: float, fitted: Mapping[str, float]
) -> dict[str, Value]:
    """Return the size of the angular momentum [kg m^2/s]."""
    size = float(np.linalg.norm([fitted[name] for name in names]))
    return {"angular_momentum": unit * size}


def _find_fractions(speeds: Sequence[float]) -> Callable[[Condition], float] | None:
    """Return the part of the momentum that each test has; None if all have the whole."""
    if len(set(speeds)) < 2:
        return None
    highest = max(map(abs, speeds))
    return lambda condition: condition.spindle_speed / highest


def _explain_rotor(body: str, unit: float, theta: Real) -> tuple[NotInMjcf, ...]:
    """Explain that an MJCF has no element for the rotor: MuJoCo has it as a motion."""
    spin = ", ".join(f"{unit * value:.4g}" for value in theta)
    return (NotInMjcf(f"{body}: angular momentum ({spin}) kg m2/s", MjcfLack.ROTOR),)


EFFECT = Effect(
    propose,
    noun="a spinning rotor",
    means="a rotor spins in {place}",
    confirm="repeat with the rotor in {place} at rest: the split of the modes goes",
    undoes=True,
)
