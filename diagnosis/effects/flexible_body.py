"""A body that bends in a mode: the data checks prove it, and a fit finds the mode.

Frequency and damping are those of the free body (``mbmodel.compliance.flexible_body``). A mode
above the band shows as a compliance alone, so that its frequency is not stated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from diagnosis.effects.scales import MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.stated_values import Value
from identification import Fault, estimate_bending_shape
from identification.words import Campaign, Dof
from mbmodel import BendingMode, Machine, add_bending_mode
from mbmodel.variants.variant_parts import has_moved_stages
from tuning import Session

# Reading of the sensor that moves most per unit of the coordinate, whose modal mass is the body's.
# Refits from a reading of 1 end in poorer minima.
_START_READING = 0.5


def propose(scene: Scene) -> tuple[Hypothesis, ...]:
    """Return none: the data checks prove it before any fit."""
    del scene
    return ()


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
