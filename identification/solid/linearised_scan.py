"""Approximate cost of hypotheses from one linearisation, also of readings that vary along lines.

The fit is linearised at the errors p of the healthy body. One Gauss-Newton step changes the cost of
other data or other priors to

    tr(P (G - V)) + p^T L p / 2 - g^T (2 N + L)^-1 g / 2

with g the gradient of the first two terms, N the information of the data and L the precision of the
priors. Data divided by readings ``h`` need only the sums of z z^H / h and z z^H / |h|^2, for all
``h`` of a scan at once. If delays are errors, the sums are weighted with w and w^2 too, as in
``DelayedSums``.
"""

from dataclasses import dataclass

import numpy as np

from identification.solid.body_channels import BodyData
from identification.solid.moments import Moments
from identification.solid.rigid_fit import RigidFitModel
from identification.solid.slope_products import Projection, SlopeProducts, project, solve_definite
from identification.words import Complex, Real

_MAX_PRODUCTS = 200_000  # products of slopes in memory at once
_MAX_SCAN_LINES = 250  # lines to which a scan thins the data; a mount or a delay is broad


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """Fit of a body, linearised at its errors.

    Args:
        errors: p; (n_error,).
        projections: projection of each group of columns.
        products: products of the slopes of the whitened rows.
    """

    errors: Real
    projections: tuple[Projection, ...]
    products: SlopeProducts

    @classmethod
    def of(cls, model: RigidFitModel, moments: Moments, errors: Real) -> "LinearisedFit":
        """Linearise a model at these errors."""
        rows = model.rows(errors) * model.scale[:, None]
        entries = model.sensors.slope_entries(errors)
        products = SlopeProducts(entries, model.scale, len(errors))
        return cls(errors, tuple(project(rows, mask) for mask in moments.mask), products)

    def costs(self, clean: Real, spread: Real, noise_scale: float) -> Real:
        """Return the data's cost over the noise scale plus the prior's cost, after one step.

        Args:
            clean: G - V of each group, and W1 and W2 if delays are errors, of each reading;
                (1 or 3, n_group, n_reading, n_channel, n_channel).
            spread: prior standard deviation of the errors; (n_error,).
            noise_scale: variance of the noise over the stated one.

        Returns:
            Costs [nats]; (n_reading,).
        """
        at_once = max(1, _MAX_PRODUCTS // len(self.errors) ** 2)
        parts = np.split(clean, range(at_once, clean.shape[2], at_once), axis=2)
        return np.concatenate([self._costs_of(part, spread, noise_scale) for part in parts])

    def _costs_of(self, clean: Real, spread: Real, noise_scale: float) -> Real:
        """Return the costs of few readings, all products in memory at once; (n_reading,)."""
        count, size = clean.shape[2], len(self.errors)
        data, gradient = np.zeros(count), np.zeros((count, size))
        information = np.zeros((count, size, size))
        for group, projection in enumerate(self.projections):
            moments, *delayed = clean[:, group]
            data += np.einsum("cd,kcd->k", projection.residual_projector, moments)
            late = (delayed[0], delayed[1]) if delayed else None
            self.products.add_to(gradient, information, projection, moments, late)
        precision = 1 / spread**2
        slopes = gradient / noise_scale + precision * self.errors
        information *= 2 / noise_scale
        places = np.arange(size)
        information[:, places, places] += precision
        prior = 0.5 * float(precision @ self.errors**2)
        gains = [
            0.5 * float(slope @ solve_definite(curvature, slope))
            for curvature, slope in zip(information, slopes, strict=True)
        ]
        return np.asarray(data / noise_scale + prior - np.array(gains), float)


@dataclass(frozen=True, eq=False)
class LineSums:
    """Sums over the columns of a group, per line: z z^H and the variance of its noise.

    Args:
        power: z z^H; (n_group, n_freq, n_channel, n_channel).
        noise: its diagonal due to noise alone; (n_group, n_freq, n_channel).
        every: number of lines of the data for one line kept.
        weights: powers of w [rad/s] with which lines are summed: 0, or 0 to 2; (n_sum, n_freq).
    """

    power: Complex
    noise: Real
    every: int
    weights: Real

    @classmethod
    def of(cls, data: BodyData, reading: Complex) -> "LineSums":
        """Sum the data of a body, thinned to some 250 lines."""
        every = max(1, len(data.freq_hz) // _MAX_SCAN_LINES)
        white = (data.white / reading)[:, ::every]
        noise = (data.noise / np.abs(reading) ** 2)[:, ::every]
        patterns, group = np.unique(data.measured, axis=0, return_inverse=True)
        power, total = [], []
        for g in np.flatnonzero(patterns.any(axis=1)):
            in_group = np.ravel(group) == g
            z = white[in_group]
            power.append(np.einsum("kfc,kfd->fcd", z, z.conj()))
            total.append(noise[in_group].sum(axis=0))
        omega = 2 * np.pi * data.freq_hz[::every]
        weights = omega ** np.arange(3 if data.sensors.has_delays else 1)[:, None]
        return cls(np.array(power), np.array(total), every, weights)

    def divide(self, readings: Complex) -> "CorrectedSums":
        """Sum over lines the data divided by each reading.

        Args:
            readings: h of each reading; (n_reading, n_freq).
        """
        inverse = 1 / readings[:, :: self.every]
        square = np.abs(inverse) ** 2
        shape = (len(self.power), len(inverse), *self.power.shape[2:])
        flat = self.power.reshape(*self.power.shape[:2], -1)
        parts = [np.imag if power == 1 else np.real for power in range(len(self.weights))]
        weighted = [(part, weight) for part, weight in zip(parts, self.weights, strict=True)]
        return CorrectedSums(
            self.every
            * np.array([part(w @ flat).reshape(shape[:1] + shape[2:]) for part, w in weighted]),
            self.every
            * np.array([part((inverse * w) @ flat).reshape(shape) for part, w in weighted]),
            self.every
            * np.array([((square * w) @ part(flat)).reshape(shape) for part, w in weighted]),
            self.every * self.noise.sum(axis=1),
            self.every * (square @ self.noise),
        )


@dataclass(frozen=True, eq=False)
class CorrectedSums:
    """Sums of products of two channels, with neither, one or both of them divided by a reading.

    The sums are G, and W1 and W2 if delays are errors.

    Args:
        gram: sums with no channel divided; (n_sum, n_group, n, n).
        half_corrected: sums with one of two channels divided; (n_sum, n_group, n_reading, n, n).
        corrected: sums with both channels divided; (n_sum, n_group, n_reading, n, n).
        noise: V with the channel not divided; (n_group, n).
        corrected_noise: V with the channel divided; (n_group, n_reading, n).
    """

    gram: Real
    half_corrected: Real
    corrected: Real
    noise: Real
    corrected_noise: Real

    def clean(self, channels: list[int]) -> Real:
        """Return G - V, and W1 and W2, with these channels divided by each reading.

        Args:
            channels: numbers of the channels; without any, the sums are those of one reading.

        Returns:
            Sums; (n_sum, n_group, n_reading, n, n).
        """
        count = self.corrected.shape[2] if channels else 1
        sums = np.repeat(self.gram[:, :, None], count, axis=2)
        noise = np.repeat(self.noise[:, None], count, axis=1)
        if channels:
            half_corrected = self.half_corrected[:, :, :, channels]
            signs = np.array([1.0, -1.0, 1.0])[: len(sums)]  # W1 is antisymmetric
            sums[:, :, :, channels] = half_corrected
            sums[..., channels] = signs[:, None, None, None, None] * np.swapaxes(
                half_corrected, -1, -2
            )
            for a in channels:
                sums[:, :, :, a, channels] = self.corrected[:, :, :, a, channels]
            noise[..., channels] = self.corrected_noise[..., channels]
        places = np.arange(sums.shape[-1])
        sums[0][..., places, places] -= noise
        return sums


def subtract_noise(moments: Moments, delays: Real | None) -> Real:
    """Return G - V, and W1 and W2 if delays are errors, summed over all blocks.

    Args:
        delays: delays that are removed [s]; (n_channel,).

    Returns:
        Sums; (n_sum, n_group, n, n).
    """
    sums = moments.fit_sums()
    return np.array([sums.clean(delays), *(sums.delay_sums(delays) or ())])
