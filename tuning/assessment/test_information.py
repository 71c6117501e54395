r"""Which further hammer point or sensor would most shrink the worst interval.

The data of a test that was not made add their normal equations before anyone makes it:

    C' = ((N + N_new) / s^2 + D)^-1,

N_new at the tuned model, with the lines, hits and noise of the tests there are (each channel has
the mean variance of its tests, a further sensor that of the sensor beside it). A new hit, a new
sensor is off by tolerances of its own, which are eliminated with all others.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identification.words import (
    Campaign,
    Dof,
    Layout,
    Real,
    distinct,
)
from mbmodel import Model, Part, hammer_parts, sensor_parts
from tuning.assessment.parameter_confidence import WIDEST, Confidence
from tuning.assessment.predicted_tests import channel_noise, foreseen
from tuning.files.schema import GainRow
from tuning.fitting.stages import thinned
from tuning.misfit.misfit import Misfit
from tuning.parametrisation.user_specification import freedom
from tuning.session import Session

_STRIDE = 8  # of the lines: what they tell is counted as often
_FURTHER = "further"
_DIGITS = 3  # of what the worst would be: beyond, all others decide


def information(session: Session, sure: Confidence) -> tuple[GainRow, ...]:
    """What each further hammer point and sensor would tell, the most telling first.

    Args:
        session: campaign and model.
        sure: what its fit is worth.
    """
    open_ones = np.flatnonzero(~sure.freedom.has_prior)
    if not open_ones.size:
        return ()
    before = sure.deviation[open_ones]
    worst = int(np.argmax(before))
    gains = []
    for what, place, model, campaign in _candidates(session, sure):
        added = _added(session, sure, model, campaign)
        after = np.sqrt(np.diag(added)[open_ones])
        gains.append(
            GainRow(
                what=what,
                place=place,
                parameter=sure.freedom.names[open_ones[worst]],
                before=float(before[worst]),
                after=float(after[worst]),
                shrink=float(np.median(after / before)),
            )
        )
    return tuple(sorted(gains, key=lambda gain: (round(gain.after, _DIGITS), gain.shrink)))


def _added(session: Session, sure: Confidence, model: Model, campaign: Campaign) -> Real:
    """C' of the coordinates there are and those of the new measurement, which come last."""
    varies = sure.freedom.extended(freedom(model, session.campaign.tolerance))
    x = np.append(sure.x, np.zeros(varies.size - sure.freedom.size))
    problem = Misfit(model, campaign, varies, allowance=0.0)
    new = problem.normal(x)[2].dense() * _STRIDE
    count = sure.freedom.size
    new[:count, :count] += sure.normal.dense()
    new /= sure.widened
    new += np.diag(np.where(varies.has_prior, 1.0, WIDEST**-2))
    scale = 1 / np.sqrt(np.diag(new))
    covariance: Real = np.linalg.inv(new * np.outer(scale, scale)) * np.outer(scale, scale)
    return covariance


def _candidates(session: Session, sure: Confidence) -> Iterator[tuple[str, str, Model, Campaign]]:
    """Hits in three directions at every sensor that was not hit; a sensor beside every sensor."""
    campaign, model = thinned(session.campaign, _STRIDE), session.model
    hit = {test.condition.reference.point for test in campaign.tests}
    outputs = distinct(d.positive for t in campaign.tests for d in t.estimate.frf.outputs)
    read, noise = dict.fromkeys(dof.point for dof in outputs), channel_noise(campaign)
    own = _like(noise, outputs)
    for place in (one for one in read if one not in hit):
        directions = tuple(Dof.of(place, axis) for axis in range(3))
        extended = _with(model, hammer_parts(model.machine, directions))
        theta = _at(extended, sure)
        yield "hammer", place, extended, foreseen(extended, theta, campaign, own, directions)
    references = distinct(test.condition.reference.positive for test in campaign.tests)
    for place in read:
        machine = replace(model.machine, layout=_beside(model, place))
        bare = Model(machine, model.parts)
        sensor = next(one for one in sensor_parts(model.machine) if one.point.name == place)
        point = replace(sensor.point, name=_FURTHER)
        extended = _with(bare, (replace(sensor, point=point),))
        alike = _like(noise, [Dof.of(place, axis) for axis in range(3)], _FURTHER)
        there, theta = replace(campaign, layout=machine.layout), _at(extended, sure)
        yield "sensor", place, extended, foreseen(extended, theta, there, alike, references)


def _with(model: Model, parts: tuple[Part, ...]) -> Model:
    return Model(model.machine, (*model.parts, *parts))


def _beside(model: Model, place: str) -> Layout:
    layout = model.machine.layout
    index = layout.points.index(place)
    return replace(
        layout,
        points=(*layout.points, _FURTHER),
        body_of=np.append(layout.body_of, layout.body_of[index]),
        positions=np.vstack([layout.positions, layout.positions[index]]),
        axes=np.concatenate([layout.axes, layout.axes[index][None]]),
    )


def _like(
    noise: Mapping[Dof, Real], known: Sequence[Dof], point: str | None = None
) -> dict[Dof, Real]:
    """Noise of channels, or of others like them at a point; where there is none the mean of all."""
    usual: Real = np.mean(list(noise.values()), axis=0)
    found = {dof: noise.get(dof, usual) for dof in known}
    return {dof if point is None else replace(dof, point=point): own for dof, own in found.items()}


def _at(model: Model, sure: Confidence) -> Real:
    """The tuned parameters, and drawn ones of what the model has more."""
    theta = sure.freedom.theta(sure.x)
    return np.append(theta, model.drawn[len(theta) :])
