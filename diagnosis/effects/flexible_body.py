"""A body that bends in a mode: the data checks prove it, and a fit finds the mode.

Frequency and damping are those of the free body (``mbmodel.compliance.flexible_body``). A mode
above the band shows as a compliance alone, so that its frequency is not stated.

Where motors or encoders test a body, and no channel shows the body itself, a mode shows by its
momentum along the joints alone (``held_mode.py``). Score tests then scan its frequency.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from diagnosis.effects.body_box import find_jacobian
from diagnosis.effects.held_mode import (
    MAX_SIZE,
    START_DAMPING_RATIO,
    HeldMode,
    build_family,
    find_leading_mode,
    find_momenta,
)
from diagnosis.effects.scales import LOG_FREQUENCY_UNIT, LOG_UNIT, MASS_SHARE_UNIT, MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_hidden_bodies, scan_resonances
from diagnosis.stated_values import Value
from identification import Fault, estimate_bending_shape
from identification.words import Campaign, Dof, Real
from mbmodel import BendingMode, Machine, add_bending_mode
from mbmodel.variants.variant_parts import has_moved_stages
from tuning import Session

# Reading of the sensor that moves most per unit of the coordinate, whose modal mass is the body's.
# Refits from a reading of 1 end in poorer minima.
_START_READING = 0.5


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield the modes of each body and frequency, where motors or encoders alone show the body.

    Elsewhere there are none: the data checks prove them before any fit.
    """
    machine, jacobian = scene.model.machine, find_jacobian(scene)
    if has_moved_stages(machine):
        return
    frequencies = scan_resonances(scene, 2 * LOG_FREQUENCY_UNIT)
    ends = frequencies[0], frequencies[-1]
    for body in list_hidden_bodies(scene):
        span = find_momenta(machine, body, jacobian)
        if not span.size:
            continue  # nothing moves it
        for at, frequency in enumerate(frequencies):
            what = f"{body}.mode{at}", f"body:{body}", frequency, span
            begin_mode = partial(_begin_mode, partial(HeldMode, *what), ends)
            parts = (build_family(*what),)
            yield Hypothesis("flexible_body", f"body:{body}", parts=parts, member=begin_mode)


def _begin_mode(
    mode: Callable[[Real], HeldMode], ends: tuple[float, float], step: Real
) -> Hypothesis | None:
    """Return the mode where a step of its family ends; None if there is none.

    Args:
        mode: of a direction.
        ends: lowest and highest frequency [Hz].
        step: entries of size v v'.
    """
    size, direction = find_leading_mode(step)
    if size <= 0:
        return None
    held = mode(direction)
    name, frequency, damping, *_ = held.names
    low, high = (np.log(np.array(ends) / held.frequency) / LOG_FREQUENCY_UNIT).tolist()
    widest = float(np.log(np.sqrt(0.5) / START_DAMPING_RATIO)) / LOG_UNIT
    most = MAX_SIZE / MASS_SHARE_UNIT
    return Hypothesis(
        "flexible_body",
        held.location,
        parts=(held.build(),),
        scored=(name,),
        begin={name: min(size, most / 2)},
        bounds={name: (0.0, most), frequency: (low, high), damping: (-widest, widest)},
        state=partial(_state_held_mode, held),
    )


def _state_held_mode(held: HeldMode, fitted: Mapping[str, float]) -> dict[str, Value]:
    """Return frequency [Hz] and damping of the free body."""
    frequency, damping = held.find_free_resonance(np.array([fitted[name] for name in held.names]))
    return {"frequency": frequency, "damping": damping}


def build_bending_hypothesis(
    fault: Fault,
    bodies: Sequence[str],
    session: Session,
    correct_campaign: Campaign,
    frequency_ratio: float = 1.0,
) -> Hypothesis:
    """Return the hypothesis of a body that bends.

    Args:
        fault: bending that the data checks prove.
        bodies: all bodies that bend.
        correct_campaign: campaign without wrong channels, for the start of the shape.
        frequency_ratio: start of the frequency of the mode, relative to its highest peak. The
            joints below and the load above the body move the peak.
    """
    body = fault.location.partition(":")[2]
    base = Hypothesis(
        fault.effect, fault.location, is_modelled=False, state=lambda _: dict(fault.parameters)
    )
    shape = estimate_bending_shape(correct_campaign, body)
    # Where a stage stands elsewhere in some test, the body above a bending one has another lever.
    if shape is None or has_moved_stages(session.model.machine):
        return base

    def reform_machine(machine: Machine) -> Machine:
        return reduce(add_bending_mode, bodies, machine)

    machine = reform_machine(session.model.machine)
    layout = machine.layout
    outputs = session.campaign.outputs
    sites = dict.fromkeys(dof.point for dof in outputs if isinstance(dof, Dof))
    sensors = tuple(site for site in sites if layout.body_name(site) == body)
    points = dict.fromkeys(
        reference.point for reference in session.campaign.inputs if isinstance(reference, Dof)
    )
    named_points = {*layout.points, *layout.bodies}
    hit_points = tuple(p for p in points if p in named_points and layout.body_name(p) == body)
    part = BendingMode(machine, body, frequency_ratio * shape.frequency, sensors, hit_points)
    begin = {f"{d.point}_{d.direction[-1]}": _START_READING * v for d, v in shape.readings.items()}
    return replace(
        base,
        parts=(part.part(),),
        begin=part.start_values(begin),
        bounds=dict.fromkeys(part.names[:2], (-MAX_LOG_STEPS, MAX_LOG_STEPS)),
        reform=reform_machine,
        is_modelled=True,
        state=partial(_state_mode, part, float(session.campaign.freq_hz[-1])),
    )


def _state_mode(part: BendingMode, highest: float, fitted: Mapping[str, float]) -> dict[str, Value]:
    """Return frequency [Hz] and damping; none above the highest line [Hz]."""
    steps = np.array([fitted.get(name, 0.0) for name in part.names[:2]])
    frequency, damping = part.frequency_and_damping(np.clip(steps, -MAX_LOG_STEPS, MAX_LOG_STEPS))
    return {"frequency": frequency, "damping": damping} if frequency <= highest else {}


EFFECT = Effect(
    propose,
    noun="bending of the body itself",
    means="{place} bends: it moves with a mode of its own",
    confirm="put more sensors on {place} and look at its shape at that frequency",
)
