r"""What a fitted model lacks, as dynamic stiffness, and the noise that this brings along.

E(w) = H_measured^-1 - H_model^-1 needs FRFs of all measured points to all of as many references.
Gains and delays of the instruments, as fitted, are divided out first.

Noise n of the tests before a change enters the FRFs H' after it, to first order, as A n B with
A = H' H^-1 and B = H^-1 H'. Its variance v adds to that of the tests after. E is a smooth course S
and features N of few lines. S alone has its own variance s and lacks features of power u. E and S
are combined for the least variance (empirical Bayes):

    u = max(|H' N H'|^2 - v, 0),   w = (u + s) / (u + s + v),   E -> S + w N,   v -> w v.

Where noise hides S too, as far below the first mode, the model is known better without it: with the
floor a of the fit before and p = sum |H'|^2, E and v shrink by b = a^2 p / (a^2 p + sum v).
Errors of S and of the model are alike on neighbouring lines. They have b^2 (1 - w)^2 s and
(1 - b)^2 a^2 |H'|^2 of the variance, which a product of neighbouring residuals holds as well.

Features are leakage of modes that ring longer than the record, or sharp modes. A drift of stiffness
moves them by a line or more, so that their part of the FRFs after, H' N H', counts as noise too;
for shifts below a line in proportion. So does the bend of H' over three lines, beyond that of
noise: where a mode is narrower than the lines, nothing tells how it looks between them.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification import smooth_variance
from identification.words import Campaign, Complex, Dof, Mask, Real, Test
from mbmodel import Evaluator, FrfRequest, Linearised, MeasuredRest, Model, find_ports
from tuning.assessment.gap import MAX_NOISE_RATIO
from tuning.misfit.batch import evaluate_tests

# Lines on each side of a line that give the slope of the rest: more than a sharp mode has, less
# than the rest's own features.
_HALF_WIDTH = 12
# Times its variance, the bend of noise over three lines has a mean of 1.5; an average of three
# lines lies below twice that.
_NOISE_BEND = 3.0
_FEATURE_LINES = 3  # lines of a leaking mode over which its features are averaged


@dataclass(frozen=True, eq=False)
class RestEstimate:
    """The rest of a model, and the FRFs from which it comes.

    Args:
        rest: E at the measured points.
        receptance: H of the tests before; (n_freq, n_out, n_in).
        variance: its variance; (n_freq, n_out, n_in).
        factor: what instruments and quantity make of it in the files; (n_freq, n_out, n_in).
        narrow: N, E less its smooth course; (n_freq, n_in, n_out).
        smooth_variance: variance of the smooth course; (n_freq, n_in, n_out).
    """

    rest: MeasuredRest
    receptance: Complex
    variance: Real
    factor: Complex
    narrow: Complex
    smooth_variance: Real


@dataclass(frozen=True, eq=False)
class CarriedNoise:
    """Variance that noise of the tests before, and drift, add to the receptances after a change.

    Args:
        variance: their variance; (n_freq, n_out, n_in).
        shared: the part of it that neighbouring lines have in common; (n_freq, n_out, n_in).
    """

    variance: Real
    shared: Real


@dataclass(frozen=True, eq=False)
class _SquareMatrix:
    """A measured square matrix of FRFs without the factors of the instruments.

    Args:
        receptance: H; (n_freq, n_out, n_in).
        variance: its variance; (n_freq, n_out, n_in).
        factor: what instruments and quantity make of it in the files; (n_freq, n_out, n_in).
    """

    receptance: Complex
    variance: Real
    factor: Complex


def estimate_rest(model: Model, theta: Real, campaign: Campaign) -> RestEstimate | None:
    """Return what a model lacks at the measured points; None without a full square matrix.

    The matrix must be that of one machine and window. On half of the lines or more, the smallest
    singular value of the model's receptance must exceed the noise: below it, the inverse is that
    of the noise.

    Args:
        theta: fitted parameters [SI]; (n_parameter,).
        campaign: tests of one state.
    """
    outputs = tuple(dof for dof in campaign.outputs if isinstance(dof, Dof))
    inputs = tuple(dof for dof in campaign.inputs if isinstance(dof, Dof))
    windows = {test.estimate.window_tau for test in campaign.tests}
    is_square = len(outputs) == len(campaign.outputs) == len(campaign.inputs) == len(inputs)
    if not is_square or campaign.variants != ("",) or len(windows) > 1:
        return None
    if model.machine.statics is not None:
        return None  # the points move with the equilibrium
    campaign = campaign.select_lines(campaign.freq_hz > 0)
    matrix = _measure_matrix(model, theta, campaign, outputs, inputs)
    if matrix is None:
        return None
    request = FrfRequest(campaign.freq_hz, outputs, inputs, "receptance", window_tau=windows.pop())
    lines = Evaluator(model, request).at(theta)
    ideal = lines.ideal_values / lines.factor[:, None, None]
    smallest = np.linalg.svd(ideal, compute_uv=False)[:, -1]
    noise = np.sqrt(matrix.variance.sum(axis=(1, 2)))
    if np.median(smallest / np.maximum(noise, np.finfo(float).tiny)) < 1:
        return None
    drawn = find_ports(model.machine, outputs, inputs)
    inverse = np.asarray(np.linalg.inv(matrix.receptance), complex)
    lacking = inverse - np.linalg.inv(ideal)
    size = np.abs(inverse) ** 2
    smooth, rate, smooth_variance = _smooth_lines(
        campaign.freq_hz, lacking, size @ matrix.variance @ size
    )
    rest = MeasuredRest(
        outputs,
        inputs,
        lines.ports.readout - drawn.readout,
        lines.ports.force - drawn.force,
        campaign.freq_hz,
        lacking,
        smooth - 0.5 * campaign.freq_hz[:, None, None] * rate,
    )
    return RestEstimate(
        rest,
        matrix.receptance,
        matrix.variance,
        matrix.factor,
        lacking - smooth,
        smooth_variance,
    )


def _measure_matrix(
    model: Model,
    theta: Real,
    campaign: Campaign,
    outputs: tuple[Dof, ...],
    inputs: tuple[Dof, ...],
) -> _SquareMatrix | None:
    """Return the mean of the measured receptances of each cell; None if a cell is missing."""
    factors = evaluate_tests(model, campaign, _find_factor, theta)
    shape = (len(campaign.freq_hz), len(outputs), len(inputs))
    total, factor = np.zeros(shape, np.complex128), np.ones(shape, np.complex128)
    variance, count = np.zeros(shape), np.zeros(shape[1:])
    for test, of_test in zip(campaign.tests, factors, strict=True):
        rows, column = _find_cells(test, outputs, inputs)
        gain = of_test[:, :, 0]
        total[:, rows, column] += test.estimate.frf.values[:, :, 0] / gain
        variance[:, rows, column] += smooth_variance(test.estimate)[:, :, 0] / np.abs(gain) ** 2
        factor[:, rows, column] = gain
        count[rows, column] += test.estimate.measured[:, 0]
    if not count.all():
        return None
    mean: Complex = np.asarray(total / count, np.complex128)
    return _SquareMatrix(mean, variance / count**2, factor)


def shrink_rest(
    estimate: RestEstimate, campaign: Campaign, floor: float, drift: float
) -> tuple[MeasuredRest, CarriedNoise]:
    """Return the rest where noise does not hide it, and what it brings to the FRFs after a change.

    Args:
        campaign: tests after the change, on the same lines.
        floor: relative model error of the fit before.
        drift: standard deviation of ln of the common factor on all stiffness.
    """
    outputs, inputs = estimate.rest.outputs, estimate.rest.inputs
    lines = np.isin(campaign.freq_hz, estimate.rest.freq_hz)
    after, noise = estimate.receptance.copy(), estimate.variance.copy()
    is_known = np.zeros(after.shape[1:], bool)
    for test in campaign.tests:
        rows, column = _find_cells(test, outputs, inputs)
        values = test.estimate.frf.values[lines, :, 0]
        gain = estimate.factor[:, rows, column]
        after[:, rows, column] = values / gain
        noise[:, rows, column] = test.estimate.variance[lines, :, 0] / np.abs(gain) ** 2
        is_known[rows, column] = test.estimate.measured[:, 0]
    if not is_known.all():
        after, noise = estimate.receptance, estimate.variance
    inverse = np.linalg.inv(estimate.receptance)
    left, right, size = (
        np.abs(after @ inverse) ** 2,
        np.abs(inverse @ after) ** 2,
        np.abs(after) ** 2,
    )
    raw, smooth = left @ estimate.variance @ right, size @ estimate.smooth_variance @ size
    features = _average_lines(np.abs(after @ estimate.narrow @ after) ** 2)
    beyond, of_noise = (
        _add_cells(each) for each in (np.maximum(features - raw, 0.0) + smooth, raw)
    )
    kept = beyond / np.maximum(beyond + of_noise, np.finfo(float).tiny)
    variance = kept * raw
    allowed = floor**2 * _add_cells(size)
    weight = allowed / (allowed + _add_cells(variance))
    whole = estimate.rest
    rest = replace(
        whole,
        values=weight * (whole.values - (1 - kept) * estimate.narrow),
        drift=weight * whole.drift,
    )
    around = np.pad(after, ((1, 1), (0, 0), (0, 0)), mode="edge")
    bend = _average_lines(np.abs(after - (around[:-2] + around[2:]) / 2) ** 2)
    moved = kept * features + np.maximum(bend - _NOISE_BEND * noise, 0.0)
    spacing = (whole.freq_hz[-1] - whole.freq_hz[0]) / max(len(whole.freq_hz) - 1, 1)
    shift = 0.5 * drift * whole.freq_hz / max(spacing, np.finfo(float).tiny)  # f is as sqrt(k)
    total = weight * variance + np.minimum(shift, 1.0)[:, None, None] ** 2 * moved
    shared = (weight * (1 - kept)) ** 2 * smooth + ((1 - weight) * floor) ** 2 * size
    return rest, CarriedNoise(np.asarray(total), np.minimum(shared, total))


def _average_lines(power: Real) -> Real:
    """Return the mean over the lines of a leaking mode; as the input.

    No running sum: its rounding can make small values beside large ones negative.
    """
    margin = _FEATURE_LINES // 2
    around = np.pad(power, ((margin, margin), (0, 0), (0, 0)), mode="edge")
    return np.mean([around[k : k + len(power)] for k in range(_FEATURE_LINES)], axis=0)


def _add_cells(power: Real) -> Real:
    """Return the sum over all cells of each line; (n_freq, 1, 1)."""
    return power.sum(axis=(1, 2), keepdims=True)


def add_variance(campaign: Campaign, estimate: RestEstimate, carried: CarriedNoise) -> Campaign:
    """Return tests with a variance of their receptances added to that of their noise.

    Args:
        campaign: tests after the change, on the lines of the tests before.
        carried: what is added.
    """
    outputs, inputs = estimate.rest.outputs, estimate.rest.inputs
    lines = np.isin(campaign.freq_hz, estimate.rest.freq_hz)
    power = np.abs(estimate.factor) ** 2
    tests = []
    for test in campaign.tests:
        rows, column = _find_cells(test, outputs, inputs)
        total, shared = test.estimate.variance.copy(), np.zeros(test.estimate.variance.shape)
        total[lines, :, 0] += (carried.variance * power)[:, rows, column]
        shared[lines, :, 0] = (carried.shared * power)[:, rows, column]
        shared /= np.maximum(total, np.finfo(float).tiny)
        estimated = replace(test.estimate, variance=total, shared=shared)
        tests.append(replace(test, estimate=estimated))
    return replace(campaign, tests=tuple(tests))


def find_known_lines(campaign: Campaign, estimate: RestEstimate, carried: CarriedNoise) -> Mask:
    """Return the lines on which the state before tells enough of the FRFs after a change.

    Around a mode that is narrower than the lines it tells nothing. A few such lines would else be
    all the noise of a channel.

    Args:
        campaign: tests after the change, on the lines of the tests before.
        carried: what it adds to the receptances after.

    Returns:
        Whether each line counts; (n_line,).
    """
    lines = np.isin(campaign.freq_hz, estimate.rest.freq_hz)
    added = (carried.variance * np.abs(estimate.factor) ** 2).sum(axis=(1, 2))
    power = sum((np.abs(test.estimate.frf.values) ** 2).sum(axis=(1, 2)) for test in campaign.tests)
    known = ~lines
    known[lines] = added < MAX_NOISE_RATIO**2 * np.asarray(power)[lines]
    return known


def _smooth_lines(freq_hz: Real, values: Complex, variance: Real) -> tuple[Complex, Complex, Real]:
    """Return a curve and its slope by a weighted straight line about each frequency line.

    Neighbouring lines alone would give the slope of the noise. Lines of large noise, as those of a
    sharp mode in a dynamic stiffness, have little weight (local regression, Cleveland 1979).

    Args:
        values: curves; (n_freq, n, n).
        variance: their variance; (n_freq, n, n).

    Returns:
        Smooth values, their slope per Hz, and the variance of the smooth values; (n_freq, n, n)
        each.
    """
    n_freq = len(freq_hz)
    spacing = (freq_hz[-1] - freq_hz[0]) / max(n_freq - 1, 1) or 1.0
    place = ((freq_hz - freq_hz.mean()) / spacing)[:, None, None]
    weight = 1 / np.maximum(variance, np.finfo(float).tiny)
    typical = np.median(weight, axis=0)
    weight = weight / typical
    first = np.clip(np.arange(n_freq) - _HALF_WIDTH, 0, n_freq)
    last = np.clip(np.arange(n_freq) + _HALF_WIDTH + 1, 0, n_freq)

    def add_up(terms: Complex | Real) -> Complex:
        total = np.concatenate([np.zeros((1, *terms.shape[1:])), np.cumsum(terms, axis=0)])
        return np.asarray(total[last] - total[first], complex)

    moments = [add_up(weight * place**power).real for power in range(3)]
    means = [add_up(weight * place**power * values) for power in range(2)]
    middle = moments[1] / moments[0]
    spread = np.maximum(moments[2] / moments[0] - middle**2, np.finfo(float).tiny)
    rate = (means[1] / moments[0] - middle * means[0] / moments[0]) / spread
    smooth = means[0] / moments[0] + rate * (place - middle)
    known = 1 / (typical * moments[0])
    return np.asarray(smooth, complex), np.asarray(rate / spacing, complex), known


def _find_factor(lines: Linearised) -> Complex:
    """Return the factor of gains, delays and quantity on a receptance; (n_freq, n_out, n_in)."""
    shape = lines.ideal_values.shape
    factor = np.broadcast_to(lines.factor[:, None, None], shape)
    if lines.output_factor is not None:
        factor = factor * lines.output_factor.T[:, :, None]
    return np.asarray(factor, complex)


def _find_cells(
    test: Test, outputs: tuple[Dof, ...], inputs: tuple[Dof, ...]
) -> tuple[list[int], int]:
    """Return the rows of a test's channels, and the column of its reference.

    Raises:
        ValueError: a channel or reference that the state before lacks.
    """
    rows = [outputs.index(dof.positive) for dof in test.estimate.frf.outputs]
    return rows, inputs.index(test.condition.reference.positive)
