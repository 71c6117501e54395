r"""Integral force feedback: the damping that struts give when their force is fed back.

A strut of stiffness k, damping c and elongation e has an actuator u beside it. A sensor in series
with both measures the force F that pushes its ends apart, and its integral is fed back:

    F = u - (k + s c) e,    u = -g / (s + w_l) F

with a leak w_l that keeps a static stiffness of k w_l / (w_l + g). It is unconditionally stable,
since it takes energy out of each strut (Preumont 2018, Vibration Control of Active Structures,
ch. 14). For one mass m with k and a spring k_p beside the strut, W^2 = (k + k_p) / m and
z^2 = k_p / m, and without leak and dampers the largest damping ratio is

    zeta = (W - z) / (2 z)    at    g = W sqrt(W / z)    if that is below one.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from identification.words import Complex, Real, UsageError
from mbmodel import Matrices, Model
from tuning.plant.damping.frames import Struts, find_struts

_GAINS_PER_DECADE = 16  # of the locus: poles of neighbouring gains are told apart by nearness
_LOWEST_GAIN, _HIGHEST_GAIN = 1e-2, 1e2  # relative to the angular frequency of the target mode
_REFINED_GAINS, _REFINEMENTS = 9, 2  # between neighbours of the best gain, and how often
_SET_SIZES = (1, 2)  # sets of struts that are compared, beside all of them
_ENOUGH_DAMPING = 0.99  # of what the highest gain gives
_MIN_IMAGINARY_PART = 1e-6  # of a pole: a real one has rounding
_LEAK_SHARE = 0.1  # of the target mode's frequency: its phase there is 6 degrees
_MAX_STRUT_SETS = 60  # each takes a locus


@dataclass(frozen=True, eq=False)
class RootLocus:
    """Poles of the target mode along the gain.

    Args:
        struts: names of the struts that are fed back.
        gain: g [rad/s]; (n_gain,).
        poles: of the target mode [rad/s]; (n_gain,).
    """

    struts: tuple[str, ...]
    gain: Real
    poles: Complex

    @property
    def damping(self) -> Real:
        """Damping ratio of the target mode; (n_gain,)."""
        return -self.poles.real / np.abs(self.poles)

    @property
    def best(self) -> int:
        """Number of the gain with the largest damping ratio.

        Where more gain always gives more, the first one that comes within 1 % of it.
        """
        best = int(np.argmax(self.damping))
        if best == len(self.gain) - 1 and self.damping[best] < 1:
            best = int(np.argmax(self.damping >= _ENOUGH_DAMPING * self.damping[best]))
        return best


@dataclass(frozen=True, eq=False)
class ForceFeedback:
    """Sets of struts and the damping that they can give.

    Args:
        target_hz: natural frequency of the target mode without feedback [Hz].
        target_damping: its damping ratio without feedback.
        share: share of all struts in its strain energy.
        leak_hz: corner of the leak [Hz].
        loci: one for each set, the best first.
        samples: damping ratios of machines of the posterior with the best set at its best gain;
            empty without a posterior; (n_sample,).
    """

    target_hz: float
    target_damping: float
    share: float
    leak_hz: float
    loci: tuple[RootLocus, ...]
    samples: Real

    def static_share(self, locus: RootLocus) -> float:
        """Return the share of the static stiffness of its struts that the best gain leaves."""
        leak = 2 * np.pi * self.leak_hz
        return float(leak / (leak + locus.gain[locus.best]))

    def interval(self) -> tuple[float, float] | None:
        """Return the 95 % interval of the best damping ratio; None without samples."""
        if not self.samples.size:
            return None
        low, high = np.quantile(self.samples, [0.025, 0.975])
        return float(low), float(high)


def feedback_dynamics(matrices: Matrices, struts: Struts, gain: float, leak: float) -> Real:
    """Return the state matrix of a machine with integral force feedback.

    The states are q, q' and the integral of each strut's force, sigma' = F - w_l sigma.

    Args:
        matrices: M, C, K of the machine with its struts.
        struts: that are fed back.
        gain: g [rad/s].
        leak: w_l [rad/s].
    """
    size, count = len(matrices.mass), len(struts.names)
    frame = struts.elongation
    inverse = np.linalg.inv(matrices.mass)
    total = np.zeros((2 * size + count, 2 * size + count))
    total[:size, size : 2 * size] = np.eye(size)
    # M q'' = -K q - C q' - g G sigma, as the springs of the struts are part of K and C.
    total[size : 2 * size, :size] = -inverse @ matrices.stiffness
    total[size : 2 * size, size : 2 * size] = -inverse @ matrices.damping
    total[size : 2 * size, 2 * size :] = -gain * inverse @ frame
    total[2 * size :, :size] = -(struts.stiffness * frame).T
    total[2 * size :, size : 2 * size] = -(struts.damping * frame).T
    total[2 * size :, 2 * size :] = -(gain + leak) * np.eye(count)
    return total


def force_feedback(
    model: Model,
    theta: Real,
    patterns: tuple[str, ...],
    *,
    target_hz: float | None = None,
    leak_hz: float | None = None,
    thetas: Real | None = None,
) -> ForceFeedback:
    """Find which struts, at which gain, damp a mode most by integral force feedback.

    Args:
        theta: parameters in SI; (n_parameter,).
        target_hz: frequency near that of the target mode [Hz]; None for the mode with the largest
            share of its strain energy in the struts.
        leak_hz: corner of the leak [Hz]; None for a tenth of the target mode's frequency.
        thetas: samples of the posterior; None for none; (n_sample, n_parameter).

    Raises:
        UsageError: no strut, or no mode that oscillates.
    """
    struts, matrices = find_struts(model, theta, patterns), model.matrices(theta)
    pole, share = _target_mode(matrices, struts, target_hz)
    leak = abs(pole) * _LEAK_SHARE if leak_hz is None else 2 * np.pi * leak_hz
    loci = [_locus(matrices, struts.select(chosen), pole, leak) for chosen in _strut_sets(struts)]
    loci.sort(key=lambda locus: -float(locus.damping.max()))
    samples = np.zeros(0)
    if thetas is not None:
        best = loci[0]
        samples = np.array(
            [
                _damping_of(model, each, best, target_hz or abs(pole) / (2 * np.pi), leak)
                for each in thetas
            ]
        )
    frequency = abs(pole) / (2 * np.pi)
    leak_hz = leak / (2 * np.pi)
    return ForceFeedback(frequency, -pole.real / abs(pole), share, leak_hz, tuple(loci), samples)


def _strut_sets(struts: Struts) -> list[tuple[int, ...]]:
    """Return sets of struts that are compared: each one, each pair, and all."""
    count = len(struts.names)
    everything: tuple[int, ...] = tuple(range(count))
    sets: list[tuple[int, ...]] = []
    for size in _SET_SIZES:
        sets.extend(combinations(everything, size))
    if len(sets) > _MAX_STRUT_SETS:
        sets = sets[: min(count, _MAX_STRUT_SETS)]
    return list(dict.fromkeys([*sets, everything]))


def _target_mode(
    matrices: Matrices, struts: Struts, target_hz: float | None
) -> tuple[complex, float]:
    """Return the pole of the target mode, and the share of the struts in its strain energy."""
    size = len(matrices.mass)
    dynamics = feedback_dynamics(matrices, struts.select([]), 0.0, 0.0)
    poles, vectors = np.linalg.eig(dynamics)
    oscillating = np.flatnonzero(poles.imag > 0)
    if not oscillating.size:
        raise UsageError("no mode of the machine oscillates: there is nothing to damp")
    shapes = vectors[:size, oscillating]
    stretch = np.abs(struts.elongation.T @ shapes) ** 2
    in_struts = (struts.stiffness[:, None] * stretch).sum(axis=0)
    whole = np.einsum("ir,ij,jr->r", shapes.conj(), matrices.stiffness, shapes).real
    shares = np.divide(in_struts, whole, out=np.zeros_like(whole), where=whole > 0)
    if target_hz is None:
        best = int(np.argmax(shares))
    else:
        best = int(np.argmin(np.abs(np.abs(poles[oscillating]) / (2 * np.pi) - target_hz)))
    return complex(poles[oscillating[best]]), float(shares[best])


def _locus(matrices: Matrices, struts: Struts, pole: complex, leak: float) -> RootLocus:
    """Return the locus of a pole, with more gains around the best one."""
    decades = np.log10(_HIGHEST_GAIN / _LOWEST_GAIN)
    gains = abs(pole) * np.geomspace(
        _LOWEST_GAIN, _HIGHEST_GAIN, int(_GAINS_PER_DECADE * decades) + 1
    )
    poles = _follow(matrices, struts, pole, gains, leak)
    gains = gains[: len(poles)]
    for _ in range(_REFINEMENTS):
        best = RootLocus(struts.names, gains, poles).best
        below = max(best - 1, 0)
        ends = gains[below], gains[min(best + 1, len(gains) - 1)]
        finer = np.geomspace(*ends, _REFINED_GAINS + 2)[1:-1]
        refined = _follow(matrices, struts, complex(poles[below]), finer, leak)
        finer = finer[: len(refined)]
        order = np.argsort(np.append(gains, finer), kind="stable")
        gains, poles = np.append(gains, finer)[order], np.append(poles, refined)[order]
    return RootLocus(struts.names, gains, poles)


def _follow(matrices: Matrices, struts: Struts, pole: complex, gains: Real, leak: float) -> Complex:
    """Return the pole at each gain: the nearest one to where the last two gains point.

    A locus ends where its pole has become real: it is critically damped, and more gain splits it.
    """
    followed = []
    previous, step = pole, 0j
    for gain in gains:
        candidates = np.linalg.eigvals(feedback_dynamics(matrices, struts, float(gain), leak))
        foretold = previous + step
        nearest = complex(candidates[np.argmin(np.abs(candidates - foretold))])
        step = nearest - previous
        previous = nearest
        followed.append(nearest)
        if nearest.imag <= _MIN_IMAGINARY_PART * abs(nearest):
            break
    return np.array(followed)


def _damping_of(
    model: Model, theta: Real, locus: RootLocus, target_hz: float, leak: float
) -> float:
    """Return the damping ratio that the best gain of a locus gives another machine."""
    matrices = model.matrices(theta)
    struts = find_struts(model, theta, locus.struts)
    pole, _ = _target_mode(matrices, struts, target_hz)
    gains = locus.gain[: locus.best + 1]
    poles = _follow(matrices, struts, pole, gains, leak)
    return float(RootLocus(locus.struts, gains[: len(poles)], poles).damping[-1])
