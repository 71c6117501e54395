"""Small mass on a spring: a cable carrier, a loose cover, a box on flexures.

``appendage_part.py`` has its dynamic stiffness. Score tests scan the natural frequency of masses
along the three world axes: felt along its axis alone, as a cable, and on every second frequency
rigid across it, as a box on flexures, whose mass may outweigh its resonance. Refits start at the
best one and fit frequency, damping, masses, place and rigid part.

An appendage is known by its resonance. A fit that ends with a frequency above the band, or with
damping beyond which there is no peak, describes an added mass, and does not count.

Its place is in the box of the body (``body_box``). Masses along axes that nothing moves are none,
and components of the place that no motion shows stay zero and are not stated.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np

from diagnosis.effects.appendage_masses import find_single_axis
from diagnosis.effects.appendage_part import SCAN_DAMPING_RATIO, AppendagePart
from diagnosis.effects.body_box import (
    bound_place,
    find_jacobian,
    find_moved_axes,
    find_shown_offsets,
    hold_at_zero,
    select_names,
)
from diagnosis.effects.scales import ARM_UNIT_M, LOG_FREQUENCY_UNIT, LOG_UNIT, MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.movable import Movable
from diagnosis.scene_points import scan_resonances
from diagnosis.stated_values import Vague, Value, state_shown
from identification.words import Mask, Real
from mbmodel import Machine


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each body, shape and frequency of the scan."""
    machine, jacobian = scene.model.machine, find_jacobian(scene)
    frequencies = scan_resonances(scene, LOG_FREQUENCY_UNIT)
    lowest, highest = frequencies[0], frequencies[-1]
    for number, body in enumerate(machine.layout.bodies):
        place = _Place.find(machine, jacobian, number)
        if not (machine.body_mass[6 * number, 6 * number] > 0 and place.moved.any()):
            continue  # the coordinate of a body's mode
        shapes = [
            *((f"{body}.appendage{at}", value, False) for at, value in enumerate(frequencies)),
            *((f"{body}.box{at}", value, True) for at, value in enumerate(frequencies[::2])),
        ]
        for name, frequency, is_box in shapes:
            if is_box and place.is_on_line:
                continue
            appendage = AppendagePart(machine, number, name, frequency, place.frame, is_box)
            yield Hypothesis(
                "appendage",
                f"body:{body}",
                parts=(appendage.build(),),
                scored=select_names(appendage.mass_names, place.moved),
                signed=True,
                bounds=_find_bounds(appendage, lowest, highest, place),
                movable=Movable(
                    (body,), partial(_read_values, appendage), partial(_start_values, appendage)
                ),
                state=partial(_state_parameters, appendage, place.shown),
                along=partial(_find_axis, appendage),
                valid_below_bound=appendage.resonance_names,
            )


@dataclass(frozen=True, eq=False)
class _Place:
    """Where on a body an appendage may be, and what the motion of the body shows of it.

    Args:
        frame: coordinates of the body among those of all bodies; (6 n_body, 6).
        moved: world axes along which something moves the appendage; (3,).
        shown: components of its place that show; (3,).
        ends: ends of its place, from the centre of mass, by axis [m].
    """

    frame: Real
    moved: Mask
    shown: Mask
    ends: tuple[tuple[float, float], ...]

    @classmethod
    def find(cls, machine: Machine, jacobian: Real, number: int) -> Self:
        """Return the place on a body."""
        frame = np.eye(len(machine.body_mass))[:, 6 * number : 6 * number + 6]
        moved = find_moved_axes(jacobian, number)
        shown = find_shown_offsets(jacobian, number, np.eye(3)[:, moved])
        ends = bound_place(machine, [number], machine.layout.centres[number])
        return cls(frame, moved, shown, ends)

    @property
    def is_on_line(self) -> bool:
        """Whether it moves along one axis, so that nothing feels if it is rigid across."""
        return bool(self.moved.sum() == 1)


def _read_values(appendage: AppendagePart, fitted: Mapping[str, float]) -> dict[str, Real]:
    """Return masses [kg], place [m], and resonance and rigid part, which need no units."""
    masses, place, shape_values = (
        np.array([fitted[name] for name in names]) for names in _group_names(appendage)
    )
    place = _find_centre(appendage) + ARM_UNIT_M * place
    return {"masses": appendage.mass_unit * masses, "place": place, "shape_values": shape_values}


def _start_values(appendage: AppendagePart, values: Mapping[str, Real]) -> dict[str, float]:
    """Return start values from those of an appendage of the same scanned frequency."""
    parts = (
        values["masses"] / appendage.mass_unit,
        (values["place"] - _find_centre(appendage)) / ARM_UNIT_M,
        values["shape_values"],
    )
    names = [name for names in _group_names(appendage) for name in names]
    return dict(zip(names, np.concatenate(parts).tolist(), strict=True))


def _find_centre(appendage: AppendagePart) -> Real:
    """Return the drawn centre of mass of the body [m]; (3,)."""
    return appendage.machine.layout.centres[appendage.number]


def _group_names(appendage: AppendagePart) -> tuple[tuple[str, ...], ...]:
    """Return the names of masses, of the place and of what needs no units."""
    resonance_and_rigid = (*appendage.resonance_names, *appendage.rigid_names)
    return appendage.mass_names, appendage.place_names, resonance_and_rigid


def _state_parameters(
    appendage: AppendagePart, shown: Mask, fitted: Mapping[str, float]
) -> dict[str, Value]:
    """Return the parameters of the verdict.

    Where an appendage lies along its axis shows only if it is rigid across.

    Args:
        shown: components of the place that some motion of the body shows; (3,).
        fitted: its parameters, by name.
    """
    omega, zeta = appendage.find_resonance(
        np.array([0.0] * 3 + [fitted[name] for name in appendage.resonance_names])
    )
    masses = np.array([fitted[name] for name in appendage.mass_names])
    place = np.array([ARM_UNIT_M * fitted[name] for name in appendage.place_names])
    single = find_single_axis(masses)
    is_rigid = appendage.find_across(fitted[appendage.rigid_names[0]]) >= 0.5
    nearest = (place if is_rigid else np.where(single, 0.0, place)).tolist()
    stated = state_shown(nearest, shown.tolist())
    return {
        "mass": appendage.mass_unit * float(masses.max()),
        "frequency": omega / (2 * np.pi),
        "damping": zeta,
        "position": Vague(stated) if single.any() else stated,
    }


def _find_axis(appendage: AppendagePart, fitted: Mapping[str, float]) -> str | None:
    """Return the axis, such as ``tx``, of an appendage that moves along one axis alone."""
    single = find_single_axis(np.array([fitted[name] for name in appendage.mass_names]))
    return f"t{'xyz'[int(np.argmax(single))]}" if single.any() else None


def _find_bounds(
    appendage: AppendagePart, lowest: float, highest: float, place: _Place
) -> dict[str, tuple[float, float]]:
    """Return the bounds of the parameters.

    The appendage weighs at most half as much as the body: with all of a body on one more spring in
    series it hangs on a softer joint, and no test tells both apart. Its damping ratio is at most
    sqrt(1/2), beyond which a resonator has no peak, and as many times less than in the scan. A body
    that hangs keeps its mass, and with it the weight at which wires have their tension.

    Args:
        lowest: lowest frequency [Hz].
        highest: highest frequency [Hz].
        place: where it may be, and what shows it.
    """
    frequency, damping = appendage.resonance_names
    ratios = np.log(np.array([lowest, highest]) / appendage.frequency) / LOG_FREQUENCY_UNIT
    widest = float(np.log(np.sqrt(0.5) / SCAN_DAMPING_RATIO)) / LOG_UNIT
    bounds = {frequency: (float(ratios[0]), float(ratios[1])), damping: (-widest, widest)}
    bounds |= dict.fromkeys(appendage.mass_names, (0.0, 0.5 / MASS_SHARE_UNIT))
    bounds |= dict.fromkeys(appendage.rigid_names, (0.0, 1.0))
    for name, (low, high) in zip(appendage.place_names, place.ends, strict=True):
        bounds[name] = low / ARM_UNIT_M, high / ARM_UNIT_M
    return bounds | hold_at_zero(
        [
            *select_names(appendage.mass_names, ~place.moved),
            *select_names(appendage.place_names, ~place.shown),
            *(appendage.rigid_names[:1] if place.is_on_line else ()),
            *(appendage.rigid_names[1:] if appendage.machine.statics is not None else ()),
        ]
    )


EFFECT = Effect(
    propose,
    noun="a small mass on a spring",
    means="a small mass on a spring hangs on {place}: a cable carrier, a loose cover",
    confirm="hold or take off what hangs on {place} and repeat: the resonance goes with it",
    undoes=True,
)
