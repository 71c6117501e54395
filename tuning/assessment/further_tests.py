"""Information of further tests: which hammer point or sensor reduces the worst interval most.

Optimal design by variance reduction (Bayesian A-optimality for a single parameter, Chaloner and
Verdinelli 1995). The covariance after a further test is known before the test is made,

    C' = ((N + N_new) / s^2 + D)^-1.

N_new are its normal equations at the tuned model, with the lines, hits and noise of the tests
made so far. Each channel has the mean variance of its tests; a further sensor has that of the
sensor beside it. The tolerances of a new hit or sensor are eliminated with all others.

Tests that were not made, predicted by a model with the noise of those that were.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identification import smooth_variance
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Input,
    Layout,
    Output,
    Real,
    Test,
    distinct_dofs,
    group_by_key,
)
from mbmodel import Evaluator, FrfRequest, Model, Part, SensorPart, hammer_parts, sensor_parts
from tuning.assessment.findings import GainRow
from tuning.assessment.parameter_confidence import ParameterConfidence, posterior_precision
from tuning.fitting.stage_search import thin_lines
from tuning.misfit.misfit import Misfit
from tuning.parametrisation.user_specification import parametrise
from tuning.session import Session

_LINE_STRIDE = 8  # every 8th line counts, eight times
_FURTHER_POINT = "further"  # name of a further sensor
_RANKING_DIGITS = 3  # of the worst deviation; ties are ranked by all others


def rank_further_tests(session: Session, confidence: ParameterConfidence) -> tuple[GainRow, ...]:
    """Rank further hammer points and sensors by the interval that would remain, shortest first.

    Args:
        confidence: confidence in the parameters so far.
    """
    return _rank(session, confidence, _candidates(session, confidence))


def rank_planned_hits(
    session: Session, confidence: ParameterConfidence, planned: Sequence[Dof]
) -> tuple[GainRow, ...]:
    """Rank places and directions that are planned by the interval that would remain.

    Args:
        session, confidence: as for ``rank_further_tests``.
        planned: places and directions.
    """
    return _rank(session, confidence, _planned_hits(session, confidence, planned))


_Candidate = tuple[str, str, Model, Campaign]  # kind, point, model and predicted campaign


def _planned_hits(
    session: Session, confidence: ParameterConfidence, planned: Sequence[Dof]
) -> Iterator[_Candidate]:
    """Yield the tests of single places and directions."""
    campaign, model = thin_lines(session.campaign, _LINE_STRIDE), session.model
    noise = mean_channel_variance(campaign)
    present = {reference.positive for reference in campaign.inputs}
    for dof in planned:
        parts = () if dof.positive in present else hammer_parts(model.machine, (dof,))
        extended = _add_parts(model, parts)
        theta = _extended_theta(extended, confidence)
        predicted = predict_tests(extended, theta, campaign, noise, (dof,))
        yield "hammer", str(dof), extended, predicted


def _rank(
    session: Session, confidence: ParameterConfidence, candidates: Iterator[_Candidate]
) -> tuple[GainRow, ...]:
    """Return the gains of further tests, the shortest interval of the worst parameter first."""
    free = np.flatnonzero(~confidence.parametrisation.is_tolerance)
    if not free.size:
        return ()
    before = confidence.deviation[free]
    worst = int(np.argmax(before))
    gains = []
    for what, place, model, campaign in candidates:
        covariance = _covariance_with(session, confidence, model, campaign)
        after = np.sqrt(np.diag(covariance)[free])
        gains.append(
            GainRow(
                what=what,
                place=place,
                parameter=confidence.parametrisation.names[free[worst]],
                before=float(before[worst]),
                after=float(after[worst]),
                shrink=float(np.median(after / before)),
            )
        )
    return tuple(sorted(gains, key=lambda gain: (round(gain.after, _RANKING_DIGITS), gain.shrink)))


def _covariance_with(
    session: Session, confidence: ParameterConfidence, model: Model, campaign: Campaign
) -> Real:
    """Return C' after a further test; coordinates of the new hit or sensor come last."""
    parametrisation = confidence.parametrisation.extend(
        parametrise(model, session.campaign.tolerance)
    )
    x = np.append(confidence.x, np.zeros(parametrisation.size - confidence.parametrisation.size))
    problem = Misfit(model, campaign, parametrisation, model_error_floor=0.0)
    information = problem.quadratic_model(x)[2].dense() * _LINE_STRIDE
    count = confidence.parametrisation.size
    information[:count, :count] += confidence.normal.dense()
    information /= confidence.variance_inflation
    information += np.diag(posterior_precision(parametrisation, x))
    scale = 1 / np.sqrt(np.diag(information))
    return np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)


def _candidates(session: Session, confidence: ParameterConfidence) -> Iterator[_Candidate]:
    """Yield the further tests: kind, point, model and predicted campaign.

    They are hits in three directions at each sensor that was not hit, and a further sensor beside
    each sensor.
    """
    campaign, model = thin_lines(session.campaign, _LINE_STRIDE), session.model
    hit = {reference.point for reference in campaign.inputs if isinstance(reference, Dof)}
    outputs = distinct_dofs(
        dof.positive for test in campaign.tests for dof in test.estimate.frf.outputs
    )
    sensors = {part.point.name for part in model.parts if isinstance(part, SensorPart)}
    read = dict.fromkeys(dof.point for dof in outputs if dof.point in sensors)
    noise = mean_channel_variance(campaign)
    channel_noise = _channel_noise(noise, outputs)
    for place in (point for point in read if point not in hit):
        directions = tuple(Dof.of(place, axis) for axis in range(3))
        extended = _add_parts(model, hammer_parts(model.machine, directions))
        theta = _extended_theta(extended, confidence)
        yield (
            "hammer",
            place,
            extended,
            predict_tests(extended, theta, campaign, channel_noise, directions),
        )
    references = campaign.inputs
    for place in read:
        machine = replace(model.machine, layout=_add_point(model, place))
        bare = Model(machine, model.parts)
        sensor = next(part for part in sensor_parts(model.machine) if part.point.name == place)
        point = replace(sensor.point, name=_FURTHER_POINT)
        extended = _add_parts(bare, (replace(sensor, point=point),))
        further_noise = _channel_noise(
            noise, [Dof.of(place, axis) for axis in range(3)], _FURTHER_POINT
        )
        extended_campaign, theta = (
            replace(campaign, layout=machine.layout),
            _extended_theta(extended, confidence),
        )
        yield (
            "sensor",
            place,
            extended,
            predict_tests(extended, theta, extended_campaign, further_noise, references),
        )


def _add_parts(model: Model, parts: tuple[Part, ...]) -> Model:
    """Return the model with further Parts."""
    return Model(model.machine, (*model.parts, *parts))


def _add_point(model: Model, place: str) -> Layout:
    """Return the layout with a further point where a sensor is."""
    layout = model.machine.layout
    index = layout.points.index(place)
    return replace(
        layout,
        points=(*layout.points, _FURTHER_POINT),
        body_of=np.append(layout.body_of, layout.body_of[index]),
        positions=np.vstack([layout.positions, layout.positions[index]]),
        axes=np.concatenate([layout.axes, layout.axes[index][None]]),
    )


def _channel_noise(
    noise: Mapping[Output, Real], channels: Sequence[Output], point: str | None = None
) -> dict[Output, Real]:
    """Return the noise of channels, the mean of all for an unknown one.

    Args:
        noise: variance of each channel; (n_freq,) each.
        channels: channels.
        point: point whose channels get that noise; None for the channels themselves.
    """
    mean: Real = np.mean(list(noise.values()), axis=0)
    by_channel = {dof: noise.get(dof, mean) for dof in channels}
    return {
        replace(dof, point=point) if point is not None and isinstance(dof, Dof) else dof: variance
        for dof, variance in by_channel.items()
    }


def _extended_theta(model: Model, confidence: ParameterConfidence) -> Real:
    """Return the tuned parameters, followed by nominal ones of additional Parts."""
    theta = confidence.parametrisation.theta(confidence.x)
    return np.append(theta, model.drawn[len(theta) :])


def predict_tests(
    model: Model,
    theta: Real,
    campaign: Campaign,
    variances: Mapping[Output, Real],
    inputs: tuple[Input, ...],
) -> Campaign:
    """Return a campaign of one predicted test for each hit.

    Args:
        theta: parameters [SI]; (n_parameter,).
        campaign: campaign with the lines and the quantity.
        variances: variance of each channel; (n_freq,) each.
        inputs: hits.
    """
    outputs, quantity = tuple(variances), campaign.tests[0].estimate.frf.quantity
    question = FrfRequest(campaign.freq_hz, outputs, inputs, quantity)
    values = Evaluator(model, question).at(theta).values
    variance = np.stack(list(variances.values()), axis=1)[:, :, None]
    measured = np.ones((len(outputs), 1), bool)
    tests = []
    for column, reference in enumerate(inputs):
        frf = Frf(campaign.freq_hz, values[:, :, [column]], outputs, (reference,), quantity)
        estimate = FrfEstimate(frf, variance, "differences", measured)
        tests.append(Test(Condition("not made", reference), estimate))
    return replace(campaign, tests=tuple(tests))


def mean_channel_variance(campaign: Campaign) -> dict[Output, Real]:
    """Return the mean variance of each channel over the tests that measured it; (n_freq,) each."""
    by_channel = group_by_key(
        (dof.positive, variance[:, row, 0])
        for estimate in (test.estimate for test in campaign.tests)
        for variance in [smooth_variance(estimate)]
        for row, dof in enumerate(estimate.frf.outputs)
        if estimate.measured[row, 0]
    )
    return {dof: np.mean(rows, axis=0) for dof, rows in by_channel.items()}
