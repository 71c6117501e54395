"""Modes of several tests, paired, and how far they differ beyond the noise of each test.

Two tests of one machine, or one test of each machine of a fleet, have modes that move and, where
two are close, mix. Modes are paired by the odds of ``identification.matching``: the MAC of the
shapes at the shared channels with the mixing of close modes, times the odds of the frequencies.
Where few channels are shared, as one encoder, the frequencies decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from identification.level_check.trends import LEVEL_CHECK_SETTINGS
from identification.matching import (
    MatchingPriors,
    best_matching,
    pair_probabilities,
    pairing_odds,
    rotate_to_real,
)
from identification.modal import IdentifiedModes, mac
from identification.words import Complex, Integers, Mask, ModalModel, Output, Real

# A joint at half its stiffness moves a mode by 30 % at most: three standard deviations.
_PRIORS = MatchingPriors(frequency_error=0.1)
_MIN_PAIRED_MAC = 0.5  # as of ``pair_shapes``: two shapes with less are no pair


@dataclass(frozen=True, eq=False)
class TestedModes:
    """Modes inside the band of one test, at the channels that all compared tests share.

    Args:
        freq_hz, freq_sd: natural frequencies and their standard deviations [Hz]; (n_mode,).
        damping, damping_sd: damping ratios and their standard deviations; (n_mode,).
        complex_shapes: shapes; (n_channel, n_mode).
        variance: variance of the values of the shapes, scaled to unit size; (n_mode, n_channel).
    """

    __test__ = False  # tells pytest that this is no test case

    freq_hz: Real
    freq_sd: Real
    damping: Real
    damping_sd: Real
    complex_shapes: Complex
    variance: Real

    @property
    def frequencies(self) -> Real:
        """Natural frequencies [Hz]; (n_mode,)."""
        return self.freq_hz

    @property
    def shapes(self) -> Real:
        """Real shapes of unit size; (n_mode, n_channel)."""
        rows = np.array([rotate_to_real(shape) for shape in self.complex_shapes.T])
        rows = rows.reshape(len(self.freq_hz), len(self.complex_shapes))
        size = np.linalg.norm(rows, axis=1)[:, None]
        return rows / np.where(size > 0, size, 1.0)


@dataclass(frozen=True)
class VisitDrift:
    """Differences between two visits to one machine that are no change; 0 for other machines.

    Args:
        frequency: relative standard deviation of all frequencies, such as by temperature.
        damping: relative standard deviation of damping ratios.
    """

    frequency: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True, eq=False)
class ComparedMode:
    """One mode in all tests; nan where a test does not have it.

    Args:
        number: number of the mode in each test, from 0; -1 where it lacks; (n_test,).
        freq_hz, freq_sd: natural frequency and its standard deviation [Hz]; (n_test,).
        damping, damping_sd: damping ratio and its standard deviation; (n_test,).
        mac: MAC with the shape in the first test that has the mode; (n_test,).
        probability: probability of the pairing with it; (n_test,).
    """

    number: Integers
    freq_hz: Real
    freq_sd: Real
    damping: Real
    damping_sd: Real
    mac: Real
    probability: Real

    @property
    def is_complete(self) -> bool:
        """Whether every test has the mode."""
        return bool((self.number >= 0).all())


@dataclass(frozen=True)
class Shift:
    """Difference of a number between two tests.

    Args:
        value: second less first.
        deviation: its standard deviation by the noise of both tests.
        drift: standard deviation of the difference between two visits without a change.
        max_chance: probability beyond noise and drift below which the number has changed.
    """

    value: float
    deviation: float
    drift: float
    max_chance: float

    @property
    def significance(self) -> float:
        """Difference in standard deviations of the noise; infinite if the noise is 0."""
        if self.deviation > 0:
            return abs(self.value) / self.deviation
        return float("inf") if self.value else 0.0

    @property
    def is_change(self) -> bool:
        """Whether neither noise nor drift between visits explains the difference."""
        total = float(np.hypot(self.deviation, self.drift))
        return abs(self.value) > -total * float(ndtri(self.max_chance / 2))


def select_modes(
    model: ModalModel, identified: IdentifiedModes, channels: Sequence[Output]
) -> TestedModes:
    """Return the modes of a band at some channels.

    Args:
        model: modal model, the modes of the band first.
        identified: its modes with their statistics, by rising frequency.
        channels: channels that all compared tests share.
    """
    count = int(identified.inside.sum())
    rows = [model.outputs.index(channel) for channel in channels]
    driven = np.abs(model.participation[:, :count])
    best = driven.argmax(axis=0) if count else np.zeros(0, np.intp)
    modes = np.arange(count)
    # A shape's value is a residue over the participation of the input that drives the mode most.
    residue_sd = identified.residue_sd[:, :, identified.inside][rows][:, best, modes]
    shapes = model.shapes[rows][:, :count]
    size = np.linalg.norm(shapes, axis=0) * driven[best, modes]
    deviation = residue_sd / np.where(size > 0, size, 1.0)
    return TestedModes(
        model.freq_hz[:count],
        model.freq_sd[:count],
        model.damping[:count],
        model.damping_sd[:count],
        shapes,
        np.asarray(deviation.T**2 / 2, np.float64),  # the other half is out of phase
    )


def pair_tests(tests: Sequence[TestedModes], band: tuple[float, float]) -> list[ComparedMode]:
    """Pair the modes of all tests, one to one.

    The modes of a test are matched with those that the tests before it have; what no test before
    it has is a new mode. The shape of a mode is that of the first test that has it.

    Args:
        tests: modes at the shared channels; at least one test.
        band: band in which they were identified [Hz].

    Returns:
        Modes by rising mean frequency.
    """
    compared: list[ComparedMode] = []
    for place, modes in enumerate(tests):
        odds = np.zeros((len(modes.freq_hz), len(compared)))
        similarity = odds
        if odds.size:
            references, means = _collect_references(tests, compared)
            similarity = mac(modes.complex_shapes, references.complex_shapes)
            odds = pairing_odds(modes, references.shapes, means, band, _PRIORS)
            odds = np.where(similarity < _MIN_PAIRED_MAC, 0.0, odds)
        pairs = best_matching(odds) if odds.size else {}
        probability = pair_probabilities(odds) if odds.size else odds
        for number in range(len(modes.freq_hz)):
            at = pairs.get(number)
            quality = (1.0, 1.0)
            if at is None:
                at = len(compared)
                compared.append(_make_empty(len(tests)))
            else:
                quality = float(similarity[number, at]), float(probability[number, at])
            compared[at] = _add_test(compared[at], place, modes, number, quality)
    return sorted(compared, key=lambda mode: float(np.nanmean(mode.freq_hz)))


def _collect_references(
    tests: Sequence[TestedModes], compared: Sequence[ComparedMode]
) -> tuple[TestedModes, Real]:
    """Return each mode in the first test that has it, and its mean frequency so far [Hz]."""
    first = [int(np.flatnonzero(mode.number >= 0)[0]) for mode in compared]
    numbers = [int(mode.number[test]) for mode, test in zip(compared, first, strict=True)]
    shapes = [tests[t].complex_shapes[:, n] for t, n in zip(first, numbers, strict=True)]
    means = np.array([np.nanmean(mode.freq_hz) for mode in compared])
    references = replace(tests[0], freq_hz=means, complex_shapes=np.stack(shapes, axis=1))
    return references, means


def _make_empty(n_test: int) -> ComparedMode:
    """Return a mode that no test has."""
    return ComparedMode(np.full(n_test, -1), *(np.full(n_test, np.nan) for _ in range(6)))


def _add_test(
    mode: ComparedMode,
    test: int,
    modes: TestedModes,
    number: int,
    quality: tuple[float, float],
) -> ComparedMode:
    """Return a mode with the values of one more test; quality is MAC and probability."""
    values = {
        "number": number,
        **{
            name: getattr(modes, name)[number]
            for name in ("freq_hz", "freq_sd", "damping", "damping_sd")
        },
        "mac": quality[0],
        "probability": quality[1],
    }
    arrays = {name: getattr(mode, name).copy() for name in values}
    for name, value in values.items():
        arrays[name][test] = value
    return replace(mode, **arrays)


def compute_shifts(
    modes: Sequence[ComparedMode], drift: VisitDrift = VisitDrift()
) -> list[tuple[Shift, Shift] | None]:
    """Return the shift of frequency [Hz] and damping ratio of each mode; None for an unpaired one.

    Args:
        modes: modes of two tests.
        drift: what differs between two visits of itself.
    """
    paired = sum(mode.is_complete for mode in modes)
    chance = LEVEL_CHECK_SETTINGS.max_chance / max(2 * paired, 1)
    return [
        (
            _shift(mode.freq_hz, mode.freq_sd, drift.frequency, chance),
            _shift(mode.damping, mode.damping_sd, drift.damping, chance),
        )
        if mode.is_complete
        else None
        for mode in modes
    ]


def _shift(values: Real, deviations: Real, drift: float, chance: float) -> Shift:
    return Shift(
        float(values[1] - values[0]),
        float(np.hypot(*deviations)),
        drift * abs(float(values[0])),
        chance,
    )


@dataclass(frozen=True, eq=False)
class FleetScatter:
    """Scatter of one number of all modes over the machines of a fleet.

    Args:
        mean: mean over the machines that have the mode; (n_mode,).
        spread: standard deviation between machines; nan for a single one; (n_mode,).
        within: standard deviation within a test, root of the mean variance; (n_mode,).
        stands_out: machines whose value lies apart from those of the others; (n_mode, n_test).
    """

    mean: Real
    spread: Real
    within: Real
    stands_out: Mask


def compute_scatter(values: Real, deviations: Real) -> FleetScatter:
    r"""Return how modes scatter between machines, and which machine stands out.

    A machine is compared with the others. With x its relative distance from their mean, s the
    relative scatter of the others, pooled over all modes with its degrees of freedom, n others of a
    mode, and d its own noise,

        T = x / sqrt(s^2 (1 + 1 / n) + d^2)

    follows Student's t if it is one of them (externally studentised residual, Cook and Weisberg
    1982). Pooling lets three machines be compared; the modes that scatter most set s.

    Args:
        values: frequencies or damping ratios, nan where a test lacks a mode; (n_mode, n_test).
        deviations: their standard deviations; (n_mode, n_test).
    """
    is_there = np.isfinite(values)
    count = is_there.sum(axis=1)
    mean = np.nansum(values, axis=1) / np.maximum(count, 1)
    variance = np.nansum((values - mean[:, None]) ** 2, axis=1) / np.maximum(count - 1, 1)
    within = np.sqrt(np.nansum(deviations**2, axis=1) / np.maximum(count, 1))
    stands_out = np.zeros(values.shape, bool)
    chance = LEVEL_CHECK_SETTINGS.max_chance / max(2 * int(is_there.sum()), 1)
    for test in range(values.shape[1]):
        remaining = np.delete(values, test, axis=1)
        n = np.isfinite(remaining).sum(axis=1)
        centre = np.nansum(remaining, axis=1) / np.maximum(n, 1)
        scale = np.where(centre == 0, 1.0, np.abs(centre))
        squares = (np.nansum((remaining - centre[:, None]) ** 2, axis=1) / scale**2)[n > 1]
        freedom = int((n[n > 1] - 1).sum())
        if not freedom:
            continue
        pooled = float(squares.sum() / freedom)
        noise = deviations[:, test] / scale
        apart = np.abs(values[:, test] - centre) / scale
        allowed = np.sqrt(pooled * (1 + 1 / np.maximum(n, 1)) + noise**2)
        limit = -float(stdtrit(freedom, chance / 2))
        stands_out[:, test] = (n > 1) & (np.nan_to_num(apart) > limit * np.nan_to_num(allowed))
    return FleetScatter(mean, np.where(count > 1, np.sqrt(variance), np.nan), within, stands_out)
