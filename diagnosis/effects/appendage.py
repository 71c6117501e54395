"""Small mass on a spring: a cable carrier, a loose cover, a box on flexures.

``appendage_part.py`` has its dynamic stiffness. Score tests scan the natural frequency of masses
along the three world axes: felt along its axis alone, as a cable, and on every second frequency
rigid across it, as a box on flexures, whose mass may outweigh its resonance. Refits start at the
best one and fit frequency, damping, masses, place and rigid part.

An appendage is known by its resonance. A fit that ends with a frequency above the band, or with
damping beyond which there is no peak, describes an added mass, and does not count.
"""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from diagnosis.effects.appendage_masses import find_single_axis
from diagnosis.effects.appendage_part import SCAN_DAMPING_RATIO, AppendagePart
from diagnosis.effects.scales import ARM_UNIT_M, LOG_FREQUENCY_UNIT, LOG_UNIT, MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Vague, Value
from diagnosis.movable import Movable
from identification.words import Real


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each body, shape and frequency of the scan."""
    machine = scene.model.machine
    band = scene.session.campaign.freq_hz
    lowest, highest = (share * float(band[-1]) for share in scene.settings.appendage_ends)
    lowest = max(float(band[band > 0].min()), lowest)
    steps = max(0, round(float(np.log(highest / lowest)) / LOG_FREQUENCY_UNIT))
    frequencies = np.geomspace(lowest, highest, steps + 1).tolist()
    for number, body in enumerate(machine.layout.bodies):
        if not machine.body_mass[6 * number, 6 * number] > 0:
            continue  # the coordinate of a body's mode
        frame = np.eye(len(machine.body_mass))[:, 6 * number : 6 * number + 6]
        shapes = [
            *((f"{body}.appendage{at}", value, False) for at, value in enumerate(frequencies)),
            *((f"{body}.box{at}", value, True) for at, value in enumerate(frequencies[::2])),
        ]
        for name, frequency, is_box in shapes:
            appendage = AppendagePart(machine, number, name, frequency, frame, is_box)
            yield Hypothesis(
                "appendage",
                f"body:{body}",
                parts=(appendage.build(),),
                scored=appendage.mass_names,
                signed=True,
                bounds=_find_bounds(
                    appendage, lowest, highest, scene.settings.max_added_mass_share
                ),
                movable=Movable(
                    (body,), partial(_read_values, appendage), partial(_start_values, appendage)
                ),
                state=partial(_state_parameters, appendage),
                along=partial(_find_axis, appendage),
                valid_below_bound=appendage.resonance_names,
            )


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
    centre: Real = appendage.machine.layout.centres[appendage.number]
    return centre


def _group_names(appendage: AppendagePart) -> tuple[tuple[str, ...], ...]:
    """Return the names of masses, of the place and of what needs no units."""
    resonance_and_rigid = (*appendage.resonance_names, *appendage.rigid_names)
    return appendage.mass_names, appendage.place_names, resonance_and_rigid


def _state_parameters(appendage: AppendagePart, fitted: Mapping[str, float]) -> dict[str, Value]:
    """Return the parameters of the verdict.

    Where an appendage lies along its axis shows only if it is rigid across.
    """
    omega, zeta = appendage.find_resonance(
        np.array([0.0] * 3 + [fitted[name] for name in appendage.resonance_names])
    )
    masses = np.array([fitted[name] for name in appendage.mass_names])
    place = np.array([ARM_UNIT_M * fitted[name] for name in appendage.place_names])
    single = find_single_axis(masses)
    is_rigid = appendage.find_across(fitted[appendage.rigid_names[0]]) >= 0.5
    nearest = (place if is_rigid else np.where(single, 0.0, place)).tolist()
    return {
        "mass": appendage.mass_unit * float(masses.max()),
        "frequency": omega / (2 * np.pi),
        "damping": zeta,
        "position": Vague(nearest) if single.any() else tuple(nearest),
    }


def _find_axis(appendage: AppendagePart, fitted: Mapping[str, float]) -> str | None:
    """Return the axis, such as ``tx``, of an appendage that moves along one axis alone."""
    single = find_single_axis(np.array([fitted[name] for name in appendage.mass_names]))
    return f"t{'xyz'[int(np.argmax(single))]}" if single.any() else None


def _find_bounds(
    appendage: AppendagePart, lowest: float, highest: float, radii: float
) -> dict[str, tuple[float, float]]:
    """Return the bounds of the parameters.

    The appendage weighs at most as much as the body. Its damping ratio is at most sqrt(1/2),
    beyond which a resonator has no peak, and as many times less than in the scan.

    Args:
        appendage: the Part.
        lowest: lowest frequency [Hz].
        highest: highest frequency [Hz].
        radii: largest distance from the centre of mass [radii of gyration].
    """
    frequency, damping = appendage.resonance_names
    ends = np.log(np.array([lowest, highest]) / appendage.frequency) / LOG_FREQUENCY_UNIT
    widest = float(np.log(np.sqrt(0.5) / SCAN_DAMPING_RATIO)) / LOG_UNIT
    inertia = appendage.inertia
    gyration = float(np.sqrt(np.trace(inertia[3:, 3:]) / inertia[0, 0]))
    reach = radii * gyration / ARM_UNIT_M
    bounds = {frequency: (float(ends[0]), float(ends[1])), damping: (-widest, widest)}
    bounds |= dict.fromkeys(appendage.mass_names, (0.0, 1 / MASS_SHARE_UNIT))
    bounds |= dict.fromkeys(appendage.rigid_names, (0.0, 1.0))
    return bounds | dict.fromkeys(appendage.place_names, (-reach, reach))


EFFECT = Effect(
    propose,
    noun="a small mass on a spring",
    means="a small mass on a spring hangs on {place}: a cable carrier, a loose cover",
    confirm="hold or take off what hangs on {place} and repeat: the resonance goes with it",
    undoes=True,
)
