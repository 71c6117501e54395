r"""What a fitted model lacks, as dynamic stiffness, and the noise that this brings along.

E(w) = H_measured^-1 - H_model^-1 needs FRFs of all measured points to all of as many references.
Gains and delays of the instruments, as fitted, are divided out first.

Noise n of the tests before a change enters the FRFs H' after it, to first order, as A n B with
A = H' H^-1 and B = H^-1 H'. Its variance v adds to that of the tests after. Where noise hides the
rest, as far below the first mode, the model is known better without it: E has a prior, the floor a
of the fit before, and with p = sum |H'|^2 and v of a line it shrinks by

    w = a^2 p / (a^2 p + sum v),    E -> w E,    v -> w v,

so that the model's error counts for what the rest does not tell (Gaussian shrinkage).
"""

from dataclasses import dataclass, replace

import numpy as np

from identification import smooth_variance
from identification.words import Campaign, Complex, Dof, Real, Test
from mbmodel import Evaluator, FrfRequest, Linearised, MeasuredRest, Model, find_ports
from tuning.misfit.batch import evaluate_tests


# Lines on each side of a line that give the slope of the rest: more than a sharp mode has, less
# than the rest's own features.
_HALF_WIDTH = 12


@dataclass(frozen=True, eq=False)
class RestEstimate:
    """The rest of a model, and the FRFs from which it comes.

    Args:
        rest: E at the measured points.
        receptance: H of the tests before; (n_freq, n_out, n_in).
        variance: its variance; (n_freq, n_out, n_in).
        factor: what instruments and quantity make of it in the files; (n_freq, n_out, n_in).
    """

    rest: MeasuredRest
    receptance: Complex
    variance: Real
    factor: Complex


def estimate_rest(model: Model, theta: Real, campaign: Campaign) -> RestEstimate | None:
    """Return what a model lacks at the measured points; None without a full square matrix.

    The matrix must be that of one machine and window. On half of the lines or more, the smallest
    singular value of the model's receptance must exceed the noise: below it, the inverse is that
    of the noise.

    Args:
        model: machine and Parts.
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
    is_moving = campaign.freq_hz > 0
    campaign = campaign.select_lines(is_moving)
    factors = evaluate_tests(model, campaign, _find_factor, theta)
    shape = (len(campaign.freq_hz), len(outputs), len(inputs))
    total, variance, factor = np.zeros(shape, complex), np.zeros(shape), np.ones(shape, complex)
    count = np.zeros(shape[1:])
    for test, of_test in zip(campaign.tests, factors, strict=True):
        rows, column = _find_cells(test, outputs, inputs)
        total[:, rows, column] += test.estimate.frf.values[:, :, 0] / of_test[:, :, 0]
        variance[:, rows, column] += (
            smooth_variance(test.estimate)[:, :, 0] / np.abs(of_test[:, :, 0]) ** 2
        )
        factor[:, rows, column] = of_test[:, :, 0]
        count[rows, column] += test.estimate.measured[:, 0]
    if not count.all():
        return None
    measured, variance = total / count, variance / count**2
    request = FrfRequest(campaign.freq_hz, outputs, inputs, "receptance", window_tau=windows.pop())
    lines = Evaluator(model, request).at(theta)
    ideal = lines.ideal_values / lines.factor[:, None, None]
    smallest = np.linalg.svd(ideal, compute_uv=False)[:, -1]
    noise = np.sqrt(variance.sum(axis=(1, 2)))
    if np.median(smallest / np.maximum(noise, np.finfo(float).tiny)) < 1:
        return None
    drawn = find_ports(model.machine, outputs, inputs)
    inverse = np.linalg.inv(measured)
    lacking = inverse - np.linalg.inv(ideal)
    size = np.abs(inverse) ** 2
    smooth, rate = _smooth_lines(campaign.freq_hz, lacking, size @ variance @ size)
    rest = MeasuredRest(
        outputs,
        inputs,
        lines.ports.readout - drawn.readout,
        lines.ports.force - drawn.force,
        campaign.freq_hz,
        lacking,
        smooth - 0.5 * campaign.freq_hz[:, None, None] * rate,
    )
    return RestEstimate(rest, measured, variance, factor)


def shrink_rest(
    estimate: RestEstimate, campaign: Campaign, floor: float
) -> tuple[MeasuredRest, Real]:
    """Return the rest where noise does not hide it, and its variance in the FRFs after a change.

    Args:
        estimate: rest of the tests before.
        campaign: tests after the change, on the same lines.
        floor: relative model error of the fit before.

    Returns:
        The rest, and the variance of receptances; (n_freq, n_out, n_in).
    """
    outputs, inputs = estimate.rest.outputs, estimate.rest.inputs
    lines = np.isin(campaign.freq_hz, estimate.rest.freq_hz)
    after = estimate.receptance.copy()
    is_known = np.zeros(after.shape[1:], bool)
    for test in campaign.tests:
        rows, column = _find_cells(test, outputs, inputs)
        values = test.estimate.frf.values[lines, :, 0]
        after[:, rows, column] = values / estimate.factor[:, rows, column]
        is_known[rows, column] = test.estimate.measured[:, 0]
    if not is_known.all():
        after = estimate.receptance
    inverse = np.linalg.inv(estimate.receptance)
    left, right = np.abs(after @ inverse) ** 2, np.abs(inverse @ after) ** 2
    variance = left @ estimate.variance @ right
    allowed = floor**2 * (np.abs(after) ** 2).sum(axis=(1, 2), keepdims=True)
    weight = allowed / (allowed + variance.sum(axis=(1, 2), keepdims=True))
    whole = estimate.rest
    rest = replace(whole, values=weight * whole.values, drift=weight * whole.drift)
    return rest, np.asarray(weight * variance)


def add_variance(campaign: Campaign, estimate: RestEstimate, variance: Real) -> Campaign:
    """Return tests with a variance of their receptances added to that of their noise.

    Args:
        campaign: tests after the change, on the lines of the tests before.
        estimate: rest of the tests before.
        variance: what is added; (n_freq, n_out, n_in).
    """
    outputs, inputs = estimate.rest.outputs, estimate.rest.inputs
    lines = np.isin(campaign.freq_hz, estimate.rest.freq_hz)
    added = variance * np.abs(estimate.factor) ** 2
    tests = []
    for test in campaign.tests:
        rows, column = _find_cells(test, outputs, inputs)
        total = test.estimate.variance.copy()
        total[lines, :, 0] += added[:, rows, column]
        tests.append(replace(test, estimate=replace(test.estimate, variance=total)))
    return replace(campaign, tests=tuple(tests))


def _smooth_lines(freq_hz: Real, values: Complex, variance: Real) -> tuple[Complex, Complex]:
    """Return a curve and its slope by a weighted straight line about each frequency line.

    Neighbouring lines alone would give the slope of the noise. Lines of large noise, as those of a
    sharp mode in a dynamic stiffness, have little weight (local regression, Cleveland 1979).

    Args:
        freq_hz: frequency lines [Hz]; (n_freq,).
        values: curves; (n_freq, n, n).
        variance: their variance; (n_freq, n, n).

    Returns:
        Smooth values, and their slope per Hz; (n_freq, n, n) each.
    """
    n_freq = len(freq_hz)
    spacing = (freq_hz[-1] - freq_hz[0]) / max(n_freq - 1, 1) or 1.0
    place = ((freq_hz - freq_hz.mean()) / spacing)[:, None, None]
    weight = 1 / np.maximum(variance, np.finfo(float).tiny)
    weight = weight / np.median(weight, axis=0)
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
    return np.asarray(smooth, complex), np.asarray(rate / spacing, complex)


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
