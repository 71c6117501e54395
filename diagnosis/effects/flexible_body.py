"""A body that bends in a mode: the data checks prove it, and a fit finds the mode.

Frequency and damping are those of the free body (``mbmodel.compliance.flexible_body``). A mode
above the band shows as a compliance alone, so that its frequency is not stated.

Where motors or encoders test a body, and no channel shows the body itself, a mode shows by its
momentum along the joints alone (``held_mode.py``). Score tests then scan its frequency.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from diagnosis.effects.appendage_part import SCAN_DAMPING_RATIO
from diagnosis.effects.body_box import find_jacobian
from diagnosis.effects.held_mode import HeldMode, ModeFamily, find_momenta
from diagnosis.effects.scales import LOG_FREQUENCY_UNIT, LOG_UNIT, MASS_SHARE_UNIT, MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.movable import Movable
from diagnosis.scene_points import list_hidden_bodies, scan_resonances
from diagnosis.stated_values import Value
from identification import Fault, estimate_bending_shape
from identification.words import Campaign, Dof, Real
from mbmodel import BendingMode, Machine, add_bending_mode, has_bending_mode
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
    for body in list_hidden_bodies(scene):
        span = find_momenta(machine, body, jacobian)
        if not span.size:
            continue  # nothing moves it
        for at, frequency in enumerate(scan_resonances(scene, 2 * LOG_FREQUENCY_UNIT)):
            family = ModeFamily(f"{body}.mode{at}", f"body:{body}", frequency, span)
            highest = float(scene.session.campaign.freq_hz[-1])
            yield Hypothesis(
                "flexible_body",
                family.location,
                parts=(family.build(),),
                member=partial(_begin_mode, family, highest),
                movable=_make_movable(family, None),
            )


def _begin_mode(family: ModeFamily, highest: float, step: Real) -> Hypothesis | None:
    """Return the mode where a step of its family ends; None if there is none.

    Args:
        family: modes of one frequency.
        highest: line of the test [Hz].
        step: entries of size v v'.
    """
    size, direction = family.find_leading(step)
    if size <= 0:
        return None
    mode = HeldMode(family, direction)
    name, frequency, damping, *_ = mode.names
    widest = float(np.log(np.sqrt(0.5) / SCAN_DAMPING_RATIO)) / LOG_UNIT
    most = 1 / MASS_SHARE_UNIT
    return Hypothesis(
        "flexible_body",
        family.location,
        parts=(mode.build(),),
        scored=(name,),
        begin={**dict.fromkeys(mode.names, 0.0), name: min(size, most / 2)},
        bounds={
            name: (0.0, most),
            frequency: (-MAX_LOG_STEPS, MAX_LOG_STEPS),
            damping: (-widest, widest),
        },
        movable=_make_movable(family, mode),
        state=partial(_state_held_mode, mode, highest),
    )


def _make_movable(family: ModeFamily, mode: HeldMode | None) -> Movable:
    """Return how a mode moves to another body: with its momenta, as far as that may have them."""

    def read(fitted: Mapping[str, float]) -> dict[str, Real]:
        if mode is None:
            return {}
        theta = np.array([fitted[name] for name in mode.names])
        return {"momenta": mode.find_momentum(theta), "resonance": theta[1:3]}

    def start(values: Mapping[str, Real]) -> dict[str, float]:
        names = [f"{family.name}.{what}" for what in ("frequency", "damping")]
        resonance = dict(zip(names, values["resonance"].tolist(), strict=True))
        return family.find_products(values["momenta"]) | resonance

    return Movable((family.location.partition(":")[2],), read, start, family.name.partition(".")[2])


def _state_held_mode(
    mode: HeldMode, highest: float, fitted: Mapping[str, float]
) -> dict[str, Value]:
    """Return frequency [Hz] and damping of the free body; none above the highest line [Hz]."""
    frequency, damping = mode.find_free_resonance(np.array([fitted[name] for name in mode.names]))
    return {"frequency": frequency, "damping": damping} if frequency <= highest else {}


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
    # Where a stage stands elsewhere in some test, the body above a bending one has another lever. A
    # machine before a change may bend already: one more mode of the body is not sought.
    nominal = session.model.machine
    if shape is None or has_moved_stages(nominal) or has_bending_mode(nominal, body):
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
