"""A first look at every hypothesis from one linearisation, and at readings that vary along lines.

At the errors p of the healthy fit the cost of other data or other priors is, after one step of
Gauss and Newton, tr(P (G - V)) + p^T L p / 2 - g^T (2 N + L)^-1 g / 2 with g the gradient of what
precedes it, N from the same data and L the priors' precision. Data divided by readings h need
only sums of z z^H / h and z z^H / |h|^2, for all h of a scan at once.
"""

from dataclasses import dataclass

import numpy as np

from identification.solid.body_channels import BodyData
from identification.solid.rigid_fit import Model, Moments, Projection, project
from identification.words import Complex, Real

_LOOKED_AT = 250  # lines


@dataclass(frozen=True, eq=False)
class Linearised:
    """A body's fit, linearised at its errors.

    Args:
        errors: p; (n_error,).
        projections: of each group of columns.
        slopes: of the whitened rows; (n_error, n_channel, 6).
        seen: the slopes in each group's spare channels; (n_group, n_error, n_channel, 6).
    """

    errors: Real
    projections: tuple[Projection, ...]
    slopes: Real
    seen: Real

    @classmethod
    def of(cls, model: Model, moments: Moments, errors: Real) -> "Linearised":
        """Linearise a model at these errors."""
        rows = model.rows(errors) * model.scale[:, None]
        slopes = model.sensors.slopes(errors) * model.scale[:, None]
        projections = tuple(project(rows, mask) for mask in moments.mask)
        seen = np.array([split.spare @ slopes for split in projections])
        return cls(errors, projections, slopes, seen)

    def cost(self, clean: Real, spread: Real, noise_scale: float) -> float:
        """Data over the noise's scale and prior, after one step.

        Args:
            clean: G - V of each group; (n_group, n_channel, n_channel).
            spread: of the errors; (n_error,).
            noise_scale: variance of the noise over the stated one.
        """
        data, gradient = 0.0, np.zeros(len(self.errors))
        information = np.zeros((len(self.errors), len(self.errors)))
        for one, split, seen in zip(clean, self.projections, self.seen, strict=True):
            inverse = split.inverse[:6]
            data += float(np.sum(split.spare * one))
            gradient -= 2 * np.tensordot(self.slopes, (inverse @ one @ split.spare).T, 2)
            flat = seen.reshape(len(self.errors), -1)
            moved = (seen @ _positive(inverse @ one @ inverse.T)).reshape(len(self.errors), -1)
            information += moved @ flat.T
        precision = 1 / spread**2
        slope = gradient / noise_scale + precision * self.errors
        curvature = 2 * information / noise_scale + np.diag(precision)
        prior = 0.5 * float(precision @ self.errors**2)
        return data / noise_scale + prior - 0.5 * float(slope @ np.linalg.solve(curvature, slope))


@dataclass(frozen=True, eq=False)
class Spectra:
    """Sums over the columns of a group, per line: z z^H (n_group, n_freq, n, n) and its noise."""

    power: Complex
    noise: Real
    every: int

    @classmethod
    def of(cls, data: BodyData, reading: Complex) -> "Spectra":
        """Of a body's data, thinned to some 250 lines."""
        every = max(1, len(data.freq_hz) // _LOOKED_AT)
        white = (data.white / reading)[:, ::every]
        noise = (data.noise / np.abs(reading) ** 2)[:, ::every]
        patterns, group = np.unique(data.measured, axis=0, return_inverse=True)
        power, total = [], []
        for g in np.flatnonzero(patterns.any(axis=1)):
            chosen = np.ravel(group) == g
            z = white[chosen]
            power.append(np.einsum("kfc,kfd->fcd", z, z.conj()))
            total.append(noise[chosen].sum(axis=0))
        return cls(np.array(power), np.array(total), every)

    def divided(self, readings: Complex) -> "Divided":
        """Sums over lines of the data divided by each reading; (n_reading, n_freq)."""
        inverse = 1 / readings[:, :: self.every]
        square = np.abs(inverse) ** 2
        shape = (len(self.power), len(inverse), *self.power.shape[2:])
        flat = self.power.reshape(*self.power.shape[:2], -1)
        return Divided(
            self.every * self.power.real.sum(axis=1),
            self.every * (inverse @ flat).real.reshape(shape),
            self.every * (square @ flat.real).reshape(shape),
            self.every * self.noise.sum(axis=1),
            self.every * (square @ self.noise),
        )


@dataclass(frozen=True, eq=False)
class Divided:
    """G with no channel, one of two, and both divided; V with the channel not and divided."""

    plain: Real
    single: Real
    double: Real
    noise: Real
    noise_double: Real

    def clean(self, reading: int, channels: list[int]) -> Real:
        """G - V with these channels divided by one reading; (n_group, n, n)."""
        gram, noise = self.plain.copy(), self.noise.copy()
        single, double = self.single[:, reading], self.double[:, reading]
        gram[:, channels] = single[:, channels]
        gram[:, :, channels] = np.swapaxes(single[:, channels], 1, 2)
        for a in channels:
            gram[:, a, channels] = double[:, a, channels]
        noise[:, channels] = self.noise_double[:, reading][:, channels]
        places = np.arange(gram.shape[1])
        gram[:, places, places] -= noise
        return gram


def clean_of(moments: Moments) -> Real:
    """G - V over all blocks; (n_group, n, n)."""
    clean: Real = moments.gram.sum(axis=1)
    places = np.arange(clean.shape[1])
    clean[:, places, places] -= moments.noise.sum(axis=1)
    return clean


def _positive(matrix: Real) -> Real:
    """The nearest matrix without negative eigenvalues: noise taken off can leave some."""
    values, vectors = np.linalg.eigh(matrix)
    nearest: Real = (vectors * np.maximum(values, 0)) @ vectors.T
    return nearest
