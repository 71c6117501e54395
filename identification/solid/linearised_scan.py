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
from identification.solid.rigid_fit import (
    Moments,
    Projection,
    RigidFitModel,
    add_delay_slopes,
    project,
)
from identification.words import Complex, Real

_MAX_SCAN_LINES = 250  # lines to which a scan thins the data; a mount or a delay is broad


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """Fit of a body, linearised at its errors.

    Args:
        errors: p; (n_error,).
        projections: projection of each group of columns.
        slopes: derivatives of the whitened rows; (n_error, n_channel, 6).
        projected_slopes: the slopes after projection of all motions; (n_group, n_error, n_channel,
            6).
    """

    errors: Real
    projections: tuple[Projection, ...]
    slopes: Real
    projected_slopes: Real

    @classmethod
    def of(cls, model: RigidFitModel, moments: Moments, errors: Real) -> "LinearisedFit":
        """Linearise a model at these errors."""
        rows = model.rows(errors) * model.scale[:, None]
        slopes = model.sensors.slopes(errors) * model.scale[:, None]
        projections = tuple(project(rows, mask) for mask in moments.mask)
        projected_slopes = np.array(
            [projection.residual_projector @ slopes for projection in projections]
        )
        return cls(errors, projections, slopes, projected_slopes)

    def cost(self, clean: Real, spread: Real, noise_scale: float) -> float:
        """Return the data's cost over the noise scale plus the prior's cost, after one step.

        Args:
            clean: G - V of each group, and W1 and W2 if delays are errors; (1 or 3, n_group,
                n_channel, n_channel).
            spread: prior standard deviation of the errors; (n_error,).
            noise_scale: variance of the noise over the stated one.
        """
        data, gradient = 0.0, np.zeros(len(self.errors))
        information = np.zeros((len(self.errors), len(self.errors)))
        for group, (projection, projected_slopes) in enumerate(
            zip(self.projections, self.projected_slopes, strict=True)
        ):
            moments, *delayed = clean[:, group]
            inverse = projection.inverse[:6]
            data += float(np.sum(projection.residual_projector * moments))
            gradient -= 2 * np.tensordot(
                self.slopes, (inverse @ moments @ projection.residual_projector).T, 2
            )
            flat = projected_slopes.reshape(len(self.errors), -1)
            mapped = (
                projected_slopes @ _nearest_semidefinite(inverse @ moments @ inverse.T)
            ).reshape(len(self.errors), -1)
            information += mapped @ flat.T
            if delayed:
                first, second = delayed
                add_delay_slopes(
                    gradient, information, projection, projected_slopes, (first, second)
                )
        precision = 1 / spread**2
        slope = gradient / noise_scale + precision * self.errors
        curvature = 2 * information / noise_scale + np.diag(precision)
        prior = 0.5 * float(precision @ self.errors**2)
        return data / noise_scale + prior - 0.5 * float(slope @ np.linalg.solve(curvature, slope))


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

    def clean(self, reading: int, channels: list[int]) -> Real:
        """Return G - V, and W1 and W2, with these channels divided by one reading.

        Returns:
            Sums; (n_sum, n_group, n, n).
        """
        sums, noise = self.gram.copy(), self.noise.copy()
        half_corrected = self.half_corrected[:, :, reading][:, :, channels]
        signs = np.array([1.0, -1.0, 1.0])[: len(sums), None, None, None]  # W1 is antisymmetric
        sums[:, :, channels] = half_corrected
        sums[:, :, :, channels] = signs * np.swapaxes(half_corrected, 2, 3)
        for a in channels:
            sums[:, :, a, channels] = self.corrected[:, :, reading, a][:, :, channels]
        noise[:, channels] = self.corrected_noise[:, reading][:, channels]
        places = np.arange(sums.shape[2])
        sums[0][:, places, places] -= noise
        return sums


def subtract_noise(moments: Moments, delays: Real | None) -> Real:
    """Return G - V, and W1 and W2 if delays are errors, summed over all blocks.

    Args:
        moments: sums of the data.
        delays: delays that are removed [s]; (n_channel,).

    Returns:
        Sums; (n_sum, n_group, n, n).
    """
    sums: tuple[Real, ...] = (moments.gram,)
    if moments.delayed is not None and delays is not None:
        sums = moments.delayed.remove(delays)
    clean: Real = np.array([blocks.sum(axis=1) for blocks in sums])
    places = np.arange(clean.shape[2])
    clean[0][:, places, places] -= moments.noise.sum(axis=1)
    return clean


def _nearest_semidefinite(matrix: Real) -> Real:
    """Return the nearest positive semidefinite matrix.

    Subtracting noise can leave negative eigenvalues.
    """
    values, vectors = np.linalg.eigh(matrix)
    nearest: Real = (vectors * np.maximum(values, 0)) @ vectors.T
    return nearest
