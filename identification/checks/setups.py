r"""Check of whether roving set-ups measured one machine, by channels that two of them share.

Accelerometers move between set-ups, and meanwhile the machine may warm up, be adjusted, or carry
the mass of the sensors elsewhere. A channel is measured twice with the hammer at one point, as H_a
and H_b. The check computes their FRAC (``identification.modal.frac``) and

    excess^2 = mean |H_b - H_a|^2 / (var_a + var_b),

which is 1 if they differ by noise alone. A real scale ``c`` for each channel and one relative shift
``e`` of all frequencies minimise

    J = sum |H_b(w) - c H_a(w / (1 + e))|^2 / (var_b + c^2 var_a)

If all stiffness changes by (1 + e)^2, an accelerance keeps its form with stretched frequencies;
other quantities do too, up to ``c``. J is the negative log-likelihood of complex Gaussian noise.
The variance of ``e`` is therefore 1 over the second derivative of J with fitted scales. It is
multiplied by J over the number of values if that ratio is above 1. If two set-ups share no
channel, their poles are compared.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from identification.modal import ModeCriteria, frac, lscf
from identification.modal.pole_clusters import cluster_poles
from identification.words import Campaign, Complex, Input, Mask, Output, Real, Test

_MAX_SHIFT = 0.05  # largest relative shift of frequencies that is searched
_N_SHIFT = 101  # shifts on the grid that starts the search
_SHIFT_TOLERANCE = 1e-9  # absolute tolerance of the best shift
_MIN_SHIFT_STEP = 1e-7  # relative shift: first step of the second difference of J
_SCALE_ITERATIONS = 3  # fixed-point iterations for the scales, whose weights depend on them
_MAX_NOISE_EXCESS = 1.5  # excess up to which two set-ups differ by noise alone
_MIN_LINES = 16  # lines for a shift by FRFs
_MAX_POLE_ORDER = 40  # highest order of the pole identification for a shift by poles
_MIN_POLE_ORDER = 4
_MAX_POLE_DISTANCE = 0.03  # relative distance of two frequencies that may be one resonance
_MAD_TO_DEVIATION = 1.4826  # standard deviation over median absolute deviation
_MEDIAN_ERROR = 1.25  # standard error of a median over that of a mean, sqrt(pi / 2)


@dataclass(frozen=True, eq=False)
class SetupCheck:
    """Comparison of two tests with the hammer at one reference.

    Args:
        names: names of both tests, by set-up or file.
        reference: reference of both tests.
        shared: channels that both measured, with the signs of the first test.
        frac: FRAC of each shared channel; (n_shared,).
        scale: best real factor from the first to the second test; (n_shared,).
        excess: root mean square of difference over noise in all shared channels; None if no
            channel is shared.
        shift: relative shift of frequencies from the first to the second test; None if unknown.
        shift_sd: standard deviation of the shift; None if unknown.
        poles: number of pole pairs that gave the shift if no channel is shared.
    """

    names: tuple[str, str]
    reference: Input
    shared: tuple[Output, ...]
    frac: Real
    scale: Real
    excess: float | None
    shift: float | None
    shift_sd: float | None
    poles: int = 0

    @property
    def agrees(self) -> bool | None:
        """Whether both tests differ by noise alone; None if that is unknown."""
        if self.excess is not None:
            return self.excess <= _MAX_NOISE_EXCESS
        if self.shift is None or self.shift_sd is None:
            return None
        return abs(self.shift) <= 2 * self.shift_sd

    @property
    def sentence(self) -> str:
        """Result of the comparison in one sentence."""
        both = f"{self.names[0]} and {self.names[1]}, hammer at {self.reference}"
        if self.shift is None or self.shift_sd is None:
            return f"{both}: they share neither a channel nor a resonance and cannot be compared"
        drift = f"frequencies shift by {100 * self.shift:+.3f} +- {196 * self.shift_sd:.3f} %"
        if self.excess is None:
            return f"{both} share no channel: {drift} over {self.poles} resonances"
        verb = "agree" if self.agrees else "differ"
        return (
            f"{both} {verb}: {self.excess:.2g} times the noise in {len(self.shared)} shared "
            f"channels, FRAC at least {self.frac.min():.4f}, scale {np.median(self.scale):.4f}, "
            f"{drift}"
        )


def compare_setups(campaign: Campaign) -> tuple[SetupCheck, ...]:
    """Compare all pairs of tests with one reference, spindle speed and level.

    Args:
        campaign: campaign on the lines of the band.
    """
    checks = []
    resonances: dict[Test, Real] = {}  # each test once: files of one channel make many pairs
    for first, second in combinations(campaign.tests, 2):
        a, b = first.condition, second.condition
        is_same_point = a.reference.positive == b.reference.positive
        hammers = {a.instrument, b.instrument}
        if len(hammers) > 1 and hammers & campaign.unknown_gains.hammers:
            continue  # their FRFs differ by a factor that nobody knows
        if is_same_point and (a.spindle_speed, a.level_n) == (b.spindle_speed, b.level_n):
            checks.append(_compare(first, second, resonances))
    return tuple(checks)


def _compare(first: Test, second: Test, resonances: dict[Test, Real]) -> SetupCheck:
    """Compare two tests by their shared channels, or by their poles.

    Args:
        first: a test.
        second: another with its reference.
        resonances: natural frequencies by test, to which those of both are added.
    """
    pair = _pair(first, second)
    names = _name(first), _name(second)
    if names[0] == names[1]:
        names = names[0], f"{names[1]} again"
    reference = first.condition.reference
    empty = np.zeros(0)
    if not pair.shared:
        first_hz, second_hz = (_known_resonances(test, resonances) for test in (first, second))
        shift, sd, count = _shift_of_poles(first_hz, second_hz)
        return SetupCheck(names, reference, (), empty, empty, None, shift, sd, count)
    noise = pair.first_var + pair.second_var
    excess = np.sqrt((np.abs(pair.second - pair.first) ** 2 / noise).mean())
    shift, sd = _shift(pair)
    return SetupCheck(
        names,
        reference,
        pair.shared,
        frac(pair.first, pair.second),
        pair.misfit(shift or 0.0)[1],
        float(excess),
        shift,
        sd,
    )


def _name(test: Test) -> str:
    """Return the name of a test by its set-up, or by its file."""
    setup = test.condition.setup
    return test.condition.test if setup is None else f"set-up {setup}"


@dataclass(frozen=True, eq=False)
class _Pair:
    """FRFs and variances of the shared channels of two tests; (n_freq, n_shared) each."""

    freq_hz: Real
    shared: tuple[Output, ...]
    first: Complex
    second: Complex
    first_var: Real
    second_var: Real

    def misfit(self, shift: float) -> tuple[float, Real]:
        """Return J of a shift and the scales that minimise it, on the lines in ``inside``."""
        inside = self.inside
        shifted = self._first_spline(self.freq_hz[inside] / (1 + shift))
        second = self.second[inside]
        first_var = self.first_var[inside]  # varies slowly: it need not be shifted
        second_var = self.second_var[inside]
        scale = np.ones(shifted.shape[1])
        for _ in range(_SCALE_ITERATIONS):
            weight = 1.0 / (second_var + scale**2 * first_var)
            product = (weight * (shifted.conj() * second).real).sum(axis=0)
            # The noise of H_a enlarges the sum of its squares and would bias the scale low.
            size = (weight * (np.abs(shifted) ** 2 - first_var)).sum(axis=0)
            scale = product / np.where(size > 0, size, np.inf)
        weight = 1.0 / (second_var + scale**2 * first_var)
        return float((weight * np.abs(second - scale * shifted) ** 2).sum()), scale

    @cached_property
    def _first_spline(self) -> CubicSpline:
        """Cubic spline of the first FRFs over frequency."""
        return CubicSpline(self.freq_hz, self.first, axis=0)

    @cached_property
    def inside(self) -> Mask:
        """Lines that every shift keeps inside the band; (n_freq,)."""
        inside: Mask = self.freq_hz >= self.freq_hz[0] * (1 + _MAX_SHIFT)
        inside &= self.freq_hz <= self.freq_hz[-1] * (1 - _MAX_SHIFT)
        return inside


def _pair(first: Test, second: Test) -> _Pair:
    """Return the shared channels of two tests on the lines above 0 Hz."""
    freq = first.estimate.frf.freq_hz
    above_zero = freq > 0
    row_of = {dof.positive: row for row, dof in enumerate(second.estimate.frf.outputs)}
    rows = [
        (row, row_of[dof.positive])
        for row, dof in enumerate(first.estimate.frf.outputs)
        if dof.positive in row_of
        and first.estimate.measured[row, 0]
        and second.estimate.measured[row_of[dof.positive], 0]
    ]
    first_rows, second_rows = [a for a, _ in rows], [b for _, b in rows]
    first_outputs, second_outputs = first.estimate.frf.outputs, second.estimate.frf.outputs
    hammer_sign = first.condition.reference.sign * second.condition.reference.sign
    signs = np.array(
        [hammer_sign * first_outputs[a].sign * second_outputs[b].sign for a, b in rows]
    )
    floor = np.finfo(float).tiny
    return _Pair(
        freq[above_zero],
        tuple(first_outputs[a] for a in first_rows),
        first.estimate.frf.values[above_zero][:, first_rows, 0],
        second.estimate.frf.values[above_zero][:, second_rows, 0] * signs,
        np.maximum(first.estimate.variance[above_zero][:, first_rows, 0], floor),
        np.maximum(second.estimate.variance[above_zero][:, second_rows, 0], floor),
    )


def _shift(pair: _Pair) -> tuple[float | None, float | None]:
    """Return the shift that minimises J and its standard deviation; None if they are unknown."""
    if pair.inside.sum() < _MIN_LINES:
        return None, None
    grid = np.linspace(-_MAX_SHIFT, _MAX_SHIFT, _N_SHIFT)
    best = int(np.argmin([pair.misfit(shift)[0] for shift in grid]))
    around = grid[max(best - 1, 0)], grid[min(best + 1, _N_SHIFT - 1)]
    minimum = minimize_scalar(
        lambda shift: pair.misfit(shift)[0],
        bounds=around,
        method="bounded",
        options={"xatol": _SHIFT_TOLERANCE},
    )
    shift = float(minimum.x)
    middle, rise, step = pair.misfit(shift)[0], 0.0, _MIN_SHIFT_STEP
    while rise < 1.0 and step < _MAX_SHIFT:  # a step of about one deviation
        step *= 2
        rise = (pair.misfit(shift - step)[0] + pair.misfit(shift + step)[0]) / 2 - middle
    if rise < 1.0:
        return None, None
    curvature = 2 * rise / step**2
    n_value = max(int(pair.inside.sum()) * pair.first.shape[1], 1)
    return shift, float(np.sqrt(max(1.0, middle / n_value) / curvature))


def _known_resonances(test: Test, resonances: dict[Test, Real]) -> Real:
    """Return the natural frequencies of a test, which are computed once."""
    if test not in resonances:
        resonances[test] = _resonances(test)
    return resonances[test]


def _shift_of_poles(first_hz: Real, second_hz: Real) -> tuple[float | None, float | None, int]:
    """Return the median shift of the resonances of two tests, its deviation, and their number.

    The standard deviation comes from the median absolute deviation of the shifts.
    """
    if not first_hz.size or not second_hz.size:
        return None, None, 0
    ratio = second_hz / first_hz[:, None] - 1
    nearest = np.abs(ratio).argmin(axis=1)
    mutual = np.abs(ratio).argmin(axis=0)[nearest] == np.arange(len(first_hz))
    shifts = ratio[np.arange(len(first_hz)), nearest][mutual]
    shifts = shifts[np.abs(shifts) < _MAX_POLE_DISTANCE]
    if len(shifts) < 2:
        return None, None, len(shifts)
    middle = float(np.median(shifts))
    scatter = _MAD_TO_DEVIATION * float(np.median(np.abs(shifts - middle)))
    return middle, _MEDIAN_ERROR * scatter / np.sqrt(len(shifts)), len(shifts)


def _resonances(test: Test) -> Real:
    """Return the natural frequencies of one test by stable poles, in ascending order [Hz]."""
    freq = test.estimate.frf.freq_hz
    above_zero = freq > 0
    values = test.estimate.frf.values[above_zero]
    size = np.sqrt((np.abs(values) ** 2).mean(axis=(0, 2)))
    highest = min(_MAX_POLE_ORDER, int(above_zero.sum()) // 2 - 1)
    if highest < _MIN_POLE_ORDER or not size.any():
        return np.zeros(0)
    rows = values[:, size > 0] / size[size > 0, None]
    orders = lscf(freq[above_zero], rows, highest)
    clusters = cluster_poles(orders, (freq[above_zero][0], freq[-1]), ModeCriteria())
    tau = test.estimate.window_tau
    poles = np.array([cluster.pole for cluster in clusters]) + (1 / tau if tau else 0.0)
    return np.sort(np.abs(poles)) / (2 * np.pi)
