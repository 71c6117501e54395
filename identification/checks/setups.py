r"""Whether the set-ups of a roved test are of one machine: channels that two of them measured.

Accelerometers are moved between set-ups, and the machine may warm up, be adjusted or carry their
mass elsewhere meanwhile. For a channel measured twice with the hammer at one place, H_a and H_b,

    excess^2 = mean |H_b - H_a|^2 / (var_a + var_b),     1 if they differ by noise alone

stands beside their FRAC (``identification.modal.frac``). Real scales c of each channel and one
relative shift e of all frequencies minimise

    J = sum |H_b(w) - c H_a(w / (1 + e))|^2 / (var_b + c^2 var_a)

An accelerance keeps its form if all stiffness changes by (1 + e)^2, and so does any quantity but
for c. J is minus the logarithm of the likelihood, so that the variance of e is 1 over its
second derivative, the scales fitted, times J over the number of values where that is above 1.
Where two set-ups share no channel, their poles are compared.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from identification.modal import Tolerances, frac, lscf
from identification.modal.pole_clusters import cluster_poles
from identification.words import Campaign, Complex, Dof, Mask, Real, Test

_WIDEST = 0.05  # relative shift of frequencies that is looked for
_GRID = 101
_STEP = 1e-7  # where second differences begin
_AGREE = 1.5  # excess up to which a difference is called noise
_LINES = 16
_ROOTS = 40
_NEAR = 0.03  # relative distance of two poles that may be one


@dataclass(frozen=True, eq=False)
class SetupCheck:
    """Two tests with the hammer at one place, compared.

    Args:
        names: of both, set-up or file.
        reference: of both.
        shared: channels that both measured, along the signs of the first.
        frac: of each shared channel; (n_shared,).
        scale: best real factor from the first to the second; (n_shared,).
        excess: difference over noise, over all shared channels; None if none is shared.
        shift: relative shift of frequencies from the first to the second, or None where nothing
            tells it.
        shift_sd: its standard deviation.
        poles: pairs of poles it was found from, where no channel is shared.
    """

    names: tuple[str, str]
    reference: Dof
    shared: tuple[Dof, ...]
    frac: Real
    scale: Real
    excess: float | None
    shift: float | None
    shift_sd: float | None
    poles: int = 0

    @property
    def agrees(self) -> bool | None:
        """Whether both differ by noise alone; None where nothing tells."""
        if self.excess is not None:
            return self.excess <= _AGREE
        if self.shift is None or self.shift_sd is None:
            return None
        return abs(self.shift) <= 2 * self.shift_sd

    @property
    def sentence(self) -> str:
        """The comparison in one sentence."""
        both = f"{self.names[0]} and {self.names[1]}, hammer at {self.reference}"
        if self.shift is None or self.shift_sd is None:
            return f"{both}: no channel was measured in both and no resonance found in both"
        drift = f"frequencies shift by {100 * self.shift:+.3f} +- {196 * self.shift_sd:.3f} %"
        if self.excess is None:
            return f"{both} share no channel: {drift} over {self.poles} resonances"
        verb = "agree" if self.agrees else "differ"
        return (
            f"{both} {verb}: {self.excess:.2g} times the noise in {len(self.shared)} shared "
            f"channels, FRAC at least {self.frac.min():.4f}, scale {np.median(self.scale):.4f}, "
            f"{drift}"
        )


def consistency(campaign: Campaign) -> tuple[SetupCheck, ...]:
    """Compare all pairs of tests with one reference, speed and level that may be set-ups.

    Args:
        campaign: its tests, lines of the band only.
    """
    checks = []
    for one, other in combinations(campaign.tests, 2):
        a, b = one.condition, other.condition
        same = a.reference.positive == b.reference.positive
        if same and (a.spindle_speed, a.level_n) == (b.spindle_speed, b.level_n):
            checks.append(_compare(one, other))
    return tuple(checks)


def _compare(one: Test, other: Test) -> SetupCheck:
    pair = _pair(one, other)
    names = _name(one), _name(other)
    if names[0] == names[1]:
        names = names[0], f"{names[1]} again"
    reference = one.condition.reference
    empty = np.zeros(0)
    if not pair.shared:
        shift, sd, count = _shift_of_poles(one, other)
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
    setup = test.condition.setup
    return test.condition.test if setup is None else f"set-up {setup}"


@dataclass(frozen=True, eq=False)
class _Pair:
    """The shared channels of two tests on the lines above 0 Hz; (n_freq, n_shared) each."""

    freq_hz: Real
    shared: tuple[Dof, ...]
    first: Complex
    second: Complex
    first_var: Real
    second_var: Real

    def misfit(self, shift: float) -> tuple[float, Real]:
        """J of a shift, and the scales that minimise it; on lines that no shift moves outside."""
        inside = self.inside
        at = self.freq_hz[inside] / (1 + shift)
        moved = self._curve(at)
        second = self.second[inside]
        one_var = self.first_var[inside]  # varies slowly
        two_var = self.second_var[inside]
        scale = np.ones(moved.shape[1])
        for _ in range(3):
            weight = 1.0 / (two_var + scale**2 * one_var)
            product = (weight * (moved.conj() * second).real).sum(axis=0)
            # Noise of H_a enlarges the sum of its squares, and would lower the scale.
            size = (weight * (np.abs(moved) ** 2 - one_var)).sum(axis=0)
            scale = product / np.where(size > 0, size, np.inf)
        weight = 1.0 / (two_var + scale**2 * one_var)
        return float((weight * np.abs(second - scale * moved) ** 2).sum()), scale

    @cached_property
    def _curve(self) -> CubicSpline:
        return CubicSpline(self.freq_hz, self.first, axis=0)

    @cached_property
    def inside(self) -> Mask:
        """Lines that stay in the band whatever the shift; (n_freq,)."""
        inside: Mask = self.freq_hz >= self.freq_hz[0] * (1 + _WIDEST)
        inside &= self.freq_hz <= self.freq_hz[-1] * (1 - _WIDEST)
        return inside


def _pair(one: Test, other: Test) -> _Pair:
    freq = one.estimate.frf.freq_hz
    moving = freq > 0
    where = {dof.positive: row for row, dof in enumerate(other.estimate.frf.outputs)}
    rows = [
        (row, where[dof.positive])
        for row, dof in enumerate(one.estimate.frf.outputs)
        if dof.positive in where
        and one.estimate.measured[row, 0]
        and other.estimate.measured[where[dof.positive], 0]
    ]
    mine, theirs = [a for a, _ in rows], [b for _, b in rows]
    outputs, inputs = one.estimate.frf.outputs, other.estimate.frf.outputs
    turned = one.condition.reference.sign * other.condition.reference.sign
    signs = np.array([turned * outputs[a].sign * inputs[b].sign for a, b in rows])
    floor = np.finfo(float).tiny
    return _Pair(
        freq[moving],
        tuple(outputs[a] for a in mine),
        one.estimate.frf.values[moving][:, mine, 0],
        other.estimate.frf.values[moving][:, theirs, 0] * signs,
        np.maximum(one.estimate.variance[moving][:, mine, 0], floor),
        np.maximum(other.estimate.variance[moving][:, theirs, 0], floor),
    )


def _shift(pair: _Pair) -> tuple[float | None, float | None]:
    """Best shift and its standard deviation."""
    if pair.inside.sum() < _LINES:
        return None, None
    grid = np.linspace(-_WIDEST, _WIDEST, _GRID)
    best = int(np.argmin([pair.misfit(shift)[0] for shift in grid]))
    around = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
    found = minimize_scalar(
        lambda shift: pair.misfit(shift)[0],
        bounds=around,
        method="bounded",
        options={"xatol": 1e-9},
    )
    shift = float(found.x)
    middle, rise, step = pair.misfit(shift)[0], 0.0, _STEP
    while rise < 1.0 and step < _WIDEST:  # where J has risen by one lies the standard deviation
        step *= 2
        rise = (pair.misfit(shift - step)[0] + pair.misfit(shift + step)[0]) / 2 - middle
    if rise < 1.0:
        return None, None
    curvature = 2 * rise / step**2
    free = max(int(pair.inside.sum()) * pair.first.shape[1], 1)
    return shift, float(np.sqrt(max(1.0, middle / free) / curvature))


def _shift_of_poles(one: Test, other: Test) -> tuple[float | None, float | None, int]:
    """Median shift of the poles that two tests have, from robust scatter its deviation."""
    first, second = _resonances(one), _resonances(other)
    if not first.size or not second.size:
        return None, None, 0
    ratio = second / first[:, None] - 1
    nearest = np.abs(ratio).argmin(axis=1)
    mutual = np.abs(ratio).argmin(axis=0)[nearest] == np.arange(len(first))
    shifts = ratio[np.arange(len(first)), nearest][mutual]
    shifts = shifts[np.abs(shifts) < _NEAR]
    if len(shifts) < 2:
        return None, None, len(shifts)
    middle = float(np.median(shifts))
    scatter = 1.4826 * float(np.median(np.abs(shifts - middle)))
    return middle, 1.25 * scatter / np.sqrt(len(shifts)), len(shifts)


def _resonances(test: Test) -> Real:
    """Natural frequencies of one test alone, by stable poles [Hz]."""
    freq = test.estimate.frf.freq_hz
    moving = freq > 0
    values = test.estimate.frf.values[moving]
    size = np.sqrt((np.abs(values) ** 2).mean(axis=(0, 2)))
    highest = min(_ROOTS, int(moving.sum()) // 2 - 1)
    if highest < 4 or not size.any():
        return np.zeros(0)
    rows = values[:, size > 0] / size[size > 0, None]
    orders = lscf(freq[moving], rows, highest)
    clusters = cluster_poles(orders, (freq[moving][0], freq[-1]), Tolerances())
    tau = test.estimate.window_tau
    poles = np.array([cluster.pole for cluster in clusters]) + (1 / tau if tau else 0.0)
    return np.sort(np.abs(poles)) / (2 * np.pi)
