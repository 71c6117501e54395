"""A link that bypasses joints, between bodies that no joint joins: a hose, a cable, a bridge.

Springs and dampers k + s c along each world axis at the point halfway between the centres of mass.
What is stated is their mean, weighted by the stiffness,

    k = sum k_a k_a / sum k_a,   c = sum k_a c_a / sum k_a:

of a link that is alike in all directions what it has in each, of one that pulls along an axis what
it has there.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from diagnosis.effects.points import joined
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import AddedPart, Addition, Change, Machine, Parameter, linked, transport

_PART = 0.01  # of the softer body's mass times the square of a frequency in the middle of the band


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each pair of bodies."""
    machine = scene.model.machine
    bodies = machine.layout.bodies
    band = scene.session.campaign.freq_hz
    omega = 2 * np.pi * float(np.sqrt(band[band > 0].min() * band[-1]))
    for low, high in combinations(range(len(bodies)), 2):
        if joined(machine, bodies[low], bodies[high]):
            continue
        mass = min(float(machine.body_mass[6 * k, 6 * k]) for k in (low, high))
        unit = _PART * mass * omega**2
        frame = _relative(machine, low, high)
        core = np.zeros((6, 3, 3, 3))
        for axis in range(3):
            core[axis, 0, axis, axis] = unit
            core[3 + axis, 1, axis, axis] = unit / omega
        place = f"pair:{bodies[low]}-{bodies[high]}"
        names = [f"{place[5:]}.{kind}_{a}" for kind in ("stiffness", "damping") for a in "xyz"]
        parameters = tuple(Parameter(name, 0.0, f"{unit:g}", positive=False) for name in names)
        part = AddedPart.linear(place, parameters, (Change("body", frame, frame, core),))
        units = np.array([unit, unit / omega])
        part = replace(part, written=partial(_written, machine, (low, high), units))
        state = partial(_state, tuple(names), units)
        yield Hypothesis("parallel_path", place, parts=(part,), signed=True, state=state)


def _state(names: tuple[str, ...], units: Real, found: Mapping[str, float]) -> dict[str, Value]:
    """Stiffness and damping in SI; none is less than nothing."""
    sizes = np.maximum(np.array([found[name] for name in names]).reshape(2, 3), 0.0)
    weights = sizes[0] if sizes[0].any() else np.ones(3)
    stiffness, damping = (units * (sizes @ weights) / weights.sum()).tolist()
    return {"stiffness": stiffness, "damping": damping}


def _relative(machine: Machine, low: int, high: int) -> np.ndarray:
    """Motion of one body less that of the other at the point between; (6 n_body, 3)."""
    centres = machine.layout.centres
    middle = (centres[low] + centres[high]) / 2
    rows = np.zeros((3, 6 * len(centres)))
    for body, sign in ((high, 1.0), (low, -1.0)):
        rows[:, 6 * body : 6 * body + 6] = sign * transport(middle - centres[body])[:3]
    return rows.T


def _written(
    machine: Machine, pair: tuple[int, int], unit: Real, theta: Real
) -> tuple[Addition, ...]:
    """A tendon along each axis that has a stiffness or damping."""
    bodies = machine.layout.bodies
    low, high = (bodies[k] for k in pair)
    middle = machine.layout.centres[list(pair)].mean(axis=0)
    found: list[Addition] = []
    for axis, name in enumerate("xyz"):
        sizes = unit * theta[[axis, 3 + axis]]
        if sizes.any():
            along = middle, np.eye(3)[axis]
            found += linked(f"{low}-{high}.{name}", machine, (low, high), along, sizes)
    return tuple(found)


EFFECT = Effect(
    propose,
    noun="a link that bypasses joints",
    means="a link bypasses the joints: a hose, a cable, a bridge",
    confirm="take the cables and hoses of {place} off and repeat: the stiffness goes",
    undoes=True,
)
