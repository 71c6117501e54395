r"""Check of the time convention of FRFs: responses must follow the force.

In the convention exp(+i w t) the inverse Fourier transform of an FRF is the response to an impulse:
it rises at once and decays afterwards. With exp(-i w t) the FRFs are conjugated, time runs
backwards, and the response grows until it stops. Magnitudes without phase have no direction of
time at all, and are refused first. The check compares the energy of all responses of
a file together before and after their largest energy. A delay only shifts both, and the sign or the
quantity of a channel does not matter (Bendat and Piersol 2010, ch. 2, on causality).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    InputError,
    Real,
    Test,
    group_by_key,
)

_MIN_EVEN_LINES = 32  # lines on an even axis, for an impulse response
_MAX_SPACING_DIFFERENCE = 1e-3  # of the spacing of lines
_N_RESOLUTIONS = (
    2  # times 1 / bandwidth: part of the time around the largest energy that is left out
)
_MIN_EARLY_SHARE = 0.9  # share of the energy before the largest, beyond which time runs backwards
# Energy outside the largest peak; below it the response is too short to have a direction.
_MIN_RINGING_SHARE = 0.05
_MIN_DECIBELS = 5.0  # smaller values are FRFs near 1, not decibels
_MIN_SHARE_DIFFERENCE = 0.05  # of early energy, by which decibels explain more than the time sign
_TINY_IMPULSE_ENERGY = 1e-300  # avoids a division by zero


@dataclass(frozen=True)
class TimeDirection:
    """Direction of time in the FRFs of one file.

    Args:
        file: name of the file.
        early_share: share of the responses' energy that precedes their largest, 0 to 1; about 0.5
            for noise, below it for responses that follow the force.
    """

    file: str
    early_share: float

    @property
    def is_reversed(self) -> bool:
        """Whether responses precede the force."""
        return self.early_share > _MIN_EARLY_SHARE


def refuse_reversed_time(path: Path, campaign: Campaign, signs: Mapping[str, str]) -> None:
    """Refuse files whose responses precede the force.

    Args:
        campaign: tests with FRFs as exp(+i w t), according to ``signs``.
        signs: stated or default ``time_sign`` of each file.

    Raises:
        InputError: the other ``time_sign`` is right, or a file holds magnitudes without phase.
    """
    for test in campaign.tests:
        if _is_magnitude(test):
            raise InputError(
                f"{path}: {test.condition.test}: all FRFs at {test.condition.reference} are real "
                "and positive, as magnitudes without phase are: export complex FRFs"
            )
    for direction in time_directions(campaign):
        if direction.is_reversed:
            if _holds_decibels(campaign, direction):
                raise InputError(
                    f"{path}: {direction.file}: its magnitudes are in decibels, and taken as such "
                    "its responses follow the force: export linear complex FRFs"
                )
            right = "+" if signs[direction.file] == "-" else "-"
            raise InputError(
                f"{path}: {direction.file}: responses precede the force, so that its FRFs follow "
                f'exp({right}i w t): set time_sign = "{right}" in its [[test]]'
            )


def _holds_decibels(campaign: Campaign, direction: TimeDirection) -> bool:
    """Return whether values taken as decibels follow the force more clearly than conjugated ones.

    Below 0 dB the stated phase is turned by half a turn.
    """
    tests = [test for test in campaign.tests if test.condition.test == direction.file]
    sizes = [np.median(np.abs(test.estimate.frf.values)) for test in tests]
    if np.median(sizes) < _MIN_DECIBELS:
        return False
    shares = [_early_share([_from_decibels(test, sign) for test in tests]) for sign in (1.0, -1.0)]
    computed_shares = [share for share in shares if share is not None]
    return min(computed_shares, default=1.0) < 1 - direction.early_share - _MIN_SHARE_DIFFERENCE


def _from_decibels(test: Test, sign: float) -> Test:
    """Return a test whose values were decibels of a sign with a phase."""
    frf = test.estimate.frf
    size = np.abs(frf.values)
    phase = sign * frf.values / np.where(size > 0, size, 1.0)
    values = np.power(10.0, np.clip(sign * size / 20, -12.0, 12.0)) * phase
    return replace(test, estimate=replace(test.estimate, frf=replace(frf, values=values)))


def _is_magnitude(test: Test) -> bool:
    """Return whether no FRF of a test has a phase: noise and damping give each value one."""
    values = test.estimate.frf.values[:, test.estimate.measured[:, 0], 0]
    is_real = not values.imag.any() and (values.real >= 0).all()
    return bool(len(values) >= _MIN_EVEN_LINES and values.any() and is_real)


def time_directions(campaign: Campaign) -> list[TimeDirection]:
    """Return the direction of time in each file of FRFs that has enough even lines."""
    tests = (test for test in campaign.tests if test.hits is None)
    files = group_by_key((test.condition.test, test) for test in tests)
    shares = {file: _early_share(tests) for file, tests in files.items()}
    return [TimeDirection(file, share) for file, share in shares.items() if share is not None]


def _early_share(tests: list[Test]) -> float | None:
    """Return the share of energy before the largest; None if the responses have no direction."""
    freq = tests[0].estimate.frf.freq_hz
    spacing = np.diff(freq)
    if len(freq) < _MIN_EVEN_LINES or np.ptp(spacing) > _MAX_SPACING_DIFFERENCE * spacing[0]:
        return None
    energy = np.sum([_impulse_energy(test) for test in tests], axis=0)
    count = len(energy)
    energy = np.roll(energy, count // 2 - int(energy.argmax()))
    early = float(energy[: count // 2 - _N_RESOLUTIONS].sum())
    late = float(energy[count // 2 + _N_RESOLUTIONS + 1 :].sum())
    if early + late < _MIN_RINGING_SHARE * max(float(energy.sum()), _TINY_IMPULSE_ENERGY):
        return None
    return early / (early + late)


def _impulse_energy(test: Test) -> Real:
    """Return the energy of the impulse responses of all channels over time; (n_freq,).

    The FRFs, as accelerances up to a constant, have a Hann window over the band and equal energy.
    The step of time is 1 over the bandwidth.
    """
    frf = test.estimate.frf
    values = frf.values[:, test.estimate.measured[:, 0], 0]
    values = values * frf.freq_hz[:, None] ** (2 - DERIVATIVE_ORDER[frf.quantity])
    window = np.hanning(len(values) + 2)[1:-1, None]
    response = np.fft.ifft(values * window, axis=0)
    energy = np.abs(response) ** 2
    return (energy / np.maximum(energy.sum(axis=0), _TINY_IMPULSE_ENERGY)).sum(axis=1)
