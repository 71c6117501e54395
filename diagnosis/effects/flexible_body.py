"""A body that bends in a mode of its own: a gate proves it, a fit finds how.

Frequency and damping are those of the free body (``mbmodel.compliance.flexible_body``). A mode
whose peak lies above the band is seen as a compliance alone: its frequency is not stated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from diagnosis.effects.scales import MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification import Fault, estimate_bending_shape
from identification.words import Campaign, Dof
from mbmodel import BendingMode, Machine, add_bending_mode
from tuning import Session

_START_READING = (
    0.5  # what the sensor that moves most begins with, per unit of the mode's coordinate
)


def propose(scene: Scene) -> tuple[Hypothesis, ...]:
    """None: spare channels of the body prove it before anything is fitted."""
    del scene
    return ()


def build_bending_hypothesis(
    fault: Fault, bodies: Sequence[str], session: Session, good: Campaign, times: float = 1.0
) -> Hypothesis:
    """The hypothesis of a body that bends.

    Args:
        fault: what the gate has proven of it.
        bodies: all that bend.
        session: campaign and model as drawn.
        good: the campaign without channels that are wrong, for a first guess.
        times: the frequency of the highest peak, where that of the mode begins: what the body
            stands on and carries moves the peak.
    """
    body = fault.location.partition(":")[2]
    base = Hypothesis(
        fault.effect, fault.location, is_modelled=False, state=lambda _: dict(fault.parameters)
    )
    seen = estimate_bending_shape(good, body)
    if seen is None:
        return base

    def reform_machine(machine: Machine) -> Machine:
        return reduce(add_bending_mode, bodies, machine)

    machine = reform_machine(session.model.machine)
    layout = machine.layout
    sites = dict.fromkeys(dof.point for dof in session.campaign.outputs)
    read = tuple(site for site in sites if layout.body_name(site) == body)
    points = dict.fromkeys(
        reference.point for reference in session.campaign.inputs if isinstance(reference, Dof)
    )
    named_points = {*layout.points, *layout.bodies}
    hit = tuple(p for p in points if p in named_points and layout.body_name(p) == body)
    part = BendingMode(machine, body, times * seen.frequency, read, hit)
    begin = {f"{d.point}_{d.direction[-1]}": _START_READING * v for d, v in seen.readings.items()}
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
    steps = np.array([fitted.get(name, 0.0) for name in part.names[:2]])
    frequency, damping = part.frequency_and_damping(np.clip(steps, -MAX_LOG_STEPS, MAX_LOG_STEPS))
    return {"frequency": frequency, "damping": damping} if frequency <= highest else {}


EFFECT = Effect(
    propose,
    noun="bending of the body itself",
    means="{place} bends: it moves with a mode of its own",
    confirm="put more sensors on {place} and look at its shape at that frequency",
)
