"""A rotor that spins inside a body: what turns it is the rate of its angular momentum H.

H turns with the body, whose rate is omega: dH/dt = omega x H = -H x omega. On the body's rotations
this is Zb -= s [H]x, skew, so that it neither stores nor loses energy: with H along z the moment
about x is H omega_y. Where tests state different spindle speeds H is in proportion to them, and
what is stated is that at the highest.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Condition, Real
from mbmodel import AddedPart, Change, NotInMjcf, Parameter

_MOMENTUM_UNIT = 10.0  # kg m2/s per unit of the parameters


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each body."""
    bodies = scene.model.machine.layout.bodies
    when = _by_speed([test.condition.spindle_speed for test in scene.session.campaign.tests])
    for number, body in enumerate(bodies):
        frame = np.zeros((6 * len(bodies), 3))
        frame[6 * number + 3 : 6 * number + 6] = np.eye(3)
        core = np.zeros((3, 3, 3, 3))
        for k, unit in enumerate(np.eye(3)):
            core[k, 1] = _MOMENTUM_UNIT * np.cross(unit, np.eye(3))  # rows of -[u]x
        names = tuple(f"{body}.angular_momentum_{axis}" for axis in "xyz")
        parameters = tuple(Parameter(name, 0.0, "10 kg m^2/s", positive=False) for name in names)
        spin = Change("body", frame, frame, core)
        part = AddedPart.linear(f"body:{body}", parameters, (spin,), when)
        part = replace(part, written=partial(_explain_rotor, body))

        def state(fitted: Mapping[str, float], spin: tuple[str, ...] = names) -> dict[str, Value]:
            size = float(np.linalg.norm([fitted[name] for name in spin]))
            return {"angular_momentum": _MOMENTUM_UNIT * size}

        yield Hypothesis("gyroscopic", f"body:{body}", parts=(part,), state=state)


def _by_speed(speeds: Sequence[float]) -> Callable[[Condition], float] | None:
    """How much of the momentum a test has; None where all have the same."""
    if len(set(speeds)) < 2:
        return None
    highest = max(map(abs, speeds))
    return lambda condition: condition.spindle_speed / highest


def _explain_rotor(body: str, theta: Real) -> tuple[NotInMjcf, ...]:
    """MuJoCo holds it as a motion, not as an element."""
    spin = ", ".join(f"{_MOMENTUM_UNIT * value:.4g}" for value in theta)
    why = f"draw the rotor as a body on a hinge of {body} and let it spin"
    return (NotInMjcf(f"{body}: angular momentum ({spin}) kg m2/s", why),)


EFFECT = Effect(
    propose,
    noun="a spinning rotor",
    means="a rotor spins in {place}",
    confirm="repeat with the rotor in {place} at rest: the split of the modes goes",
    undoes=True,
)
