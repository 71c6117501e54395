"""What an excitation will show: intervals of parameters, coherence, and joints that slide."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from identification.noise.variance import implied_coherence
from identification.words import JOINT_PREFIX, Complex, Input, Output, Real, Signal
from mbmodel import (
    DryFriction,
    Evaluator,
    FrfRequest,
    JenkinsElement,
    NonlinearJoint,
    Parameter,
)
from tuning.assessment.parameter_confidence import ParameterConfidence
from tuning.excitation.design import SPRING_KINDS, Excitation, output_noise
from tuning.misfit.misfit import Misfit

# A mass under a harmonic force moves without stops if the force is above the friction by this
# factor, (1 + pi^2 / 4)^1/2 (Den Hartog 1931).
MIN_FORCE_OVER_FRICTION = float(np.sqrt(1 + np.pi**2 / 4))
MIN_SLIDING_SHARE = 0.9  # of the time: less is stiffness to a linear model as well


def predict_confidence(excitation: Excitation) -> ParameterConfidence:
    """Return the confidence that a tuning to the predicted tests has, all tolerances included."""
    varies = excitation.parametrisation
    x = varies.coordinates(excitation.theta)
    misfit = Misfit(excitation.model, excitation.campaign, varies, model_error_floor=0.0)
    return ParameterConfidence(varies, x, misfit.quadratic_model(x)[2], 1.0)


def forecast_rows(
    confidence: ParameterConfidence,
) -> Iterator[tuple[Parameter, float, float, float, bool]]:
    """Yield each stiffness and damping: nominal value, 95 % interval [SI], whether determined."""
    varies = confidence.parametrisation
    theta, vague = varies.theta(confidence.x), confidence.unidentifiable
    for number, (low, high) in enumerate(zip(*confidence.interval(), strict=True)):
        parameter = varies.parameters[number]
        if parameter.known in SPRING_KINDS and varies.free[number]:
            yield parameter, float(theta[number]), float(low), float(high), not bool(vague[number])


def predict_record(excitation: Excitation, random: np.random.Generator) -> Real:
    """Return what the nominal machine records, settled from the start, with noise; (n_out, n_time).

    Args:
        random: source of the noise.
    """
    plan, request = excitation.plan, excitation.request
    values = np.stack([test.estimate.frf.values[:, :, 0] for test in excitation.campaign.tests], 2)
    waveforms = [excitation.waveforms(values[:, row]) for row in range(len(request.outputs))]
    record = excitation.repeat(np.stack(waveforms, axis=1))
    # White noise of one-sided density S has the variance S f / 2 a sample.
    white = random.standard_normal(record.shape) * np.sqrt(plan.rate_hz / 2)
    freq_hz = np.fft.rfftfreq(record.shape[1], 1 / plan.rate_hz)
    density = output_noise(excitation.model, excitation.theta, request, plan.freq_hz)
    for row in range(len(record)):
        shape = np.interp(freq_hz, plan.freq_hz, density[:, row])
        record[row] += np.fft.irfft(np.fft.rfft(white[row]) * shape, record.shape[1])
    return record


@dataclass(frozen=True, eq=False)
class CoherenceRow:
    """Coherence of an output and a drive.

    Args:
        drive: the drive.
        output: the output.
        coherence: at each line; (n_freq,).
    """

    drive: Input
    output: Output
    coherence: Real


def predict_coherence(excitation: Excitation) -> list[CoherenceRow]:
    """Return the coherence of each drive and output, as ``mbw identify`` will state it."""
    rows = []
    for test in excitation.campaign.tests:
        estimate = test.estimate
        values = implied_coherence(estimate.frf.values, estimate.variance, estimate.averages or 2)
        rows += [
            CoherenceRow(test.condition.reference, output, values[:, row, 0])
            for row, output in enumerate(estimate.frf.outputs)
        ]
    return rows


@dataclass(frozen=True)
class SlidingRow:
    """A joint with friction under an excitation.

    Args:
        joint: name of the slide or hinge.
        limit: force at which it slides [N, N m].
        sliding: part of the time in which it slides, by the motion of the linear model; None for
            dry friction.
        force_ratio: largest force that acts on the joint over the limit; None for friction that
            sticks as a spring.
        slides: whether the joint slides all the time, but for a moment at reversals.
    """

    joint: str
    limit: float
    sliding: float | None
    force_ratio: float | None
    slides: bool


def predict_sliding(excitation: Excitation, laws: Sequence[NonlinearJoint]) -> list[SlidingRow]:
    """Return how the joints with friction move.

    The linear model is without dry friction, and has the sticking spring of a Jenkins element. So
    its motion is that of a joint that sticks, which moves less than one that slides.

    Args:
        laws: nonlinear joints of the machine.
    """
    rows = []
    for law in laws:
        if not isinstance(law, DryFriction | JenkinsElement):
            continue
        moved, response = _joint_motion(excitation, law.joint)
        if isinstance(law, JenkinsElement):
            sliding = max(sliding_share(path, law.k, law.limit) for path in moved)
            slides = sliding >= MIN_SLIDING_SHARE
            rows.append(SlidingRow(law.joint, law.limit, sliding, None, slides))
            continue
        forces = excitation.waveforms(_applied_force(excitation, law.joint, response))
        ratio = float(np.abs(forces).max()) / law.limit
        rows.append(SlidingRow(law.joint, law.limit, None, ratio, ratio >= MIN_FORCE_OVER_FRICTION))
    return rows


def sliding_share(path: Real, stiffness: float, limit: float) -> float:
    """Return in which part of a period a Jenkins element slides.

    Args:
        path: one period of the coordinate; (n_sample,).
        stiffness: while it sticks.
        limit: force at which it slides.
    """
    force, slid = 0.0, 0
    steps = stiffness * np.diff(path, append=path[:1])
    for _ in range(2):  # the first period leaves the start behind
        slid = 0
        for step in steps.tolist():
            force += step
            if abs(force) > limit:
                force, slid = float(np.copysign(limit, force)), slid + 1
    return slid / len(steps)


def _joint_motion(excitation: Excitation, joint: str) -> tuple[Real, Complex]:
    """Return periods of a joint's motion; (n_realisation, n_sample), and its FRFs."""
    place, drives = Signal(JOINT_PREFIX + joint), excitation.request.drives
    request = FrfRequest(excitation.plan.freq_hz, (place,), drives, "receptance")
    response = Evaluator(excitation.model, request).at(excitation.theta).values[:, 0]
    return excitation.waveforms(response), response


def _applied_force(excitation: Excitation, joint: str, response: Complex) -> Complex:
    """Return the force that would hold a joint still, per unit of each drive; (n_freq, n_drive).

    It is the joint's motion by the drives over its motion by a force along it.
    """
    place = Signal(JOINT_PREFIX + joint)
    request = FrfRequest(excitation.plan.freq_hz, (place,), (place,), "receptance")
    drive_point = Evaluator(excitation.model, request).at(excitation.theta).values[:, 0]
    return np.asarray(response / drive_point, np.complex128)
