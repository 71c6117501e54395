r"""Errors of sensors from rigid motion: all motions projected out, tolerances as priors.

With z the whitened channels of a line and a hit, B(p) the whitened rows and x free,

    min_x |z - B x|^2 = z^H P z,   P = 1 - B B^+,

and its sum over lines and hits is tr(P G), G = sum Re(z z^H): a fit needs no more than one small
matrix per block of lines. Noise alone gives tr(P V), V its diagonal, so that tr(P (G - V)) is not
biased by noise however weights were chosen (errors in variables with known noise; Fuller 1987,
ch. 2). One unit is one nat: z has the density exp(-|z - B x|^2).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.solid.body_channels import BodyData
from identification.solid.sensor_errors import Sensors
from identification.words import Complex, Integers, Mask, Real

_NOTHING = 1e-9  # of the longest column: what rounding leaves of a motion that is none
_RANK = 1e-6
_STEPS = 8
_HALVINGS = 6
_DONE = 1e-2  # nats
BLOCKS = 24


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over lines and hits, per group of columns with the same channels and block of lines.

    Args:
        mask: channels of each group; (n_group, n_channel).
        gram: sum Re(z z^H); (n_group, n_block, n_channel, n_channel).
        noise: what noise alone would give on its diagonal; (n_group, n_block, n_channel).
        count: values summed; (n_group, n_block).
    """

    mask: Mask
    gram: Real
    noise: Real
    count: Real

    @classmethod
    def of(
        cls, data: BodyData, reading: Complex | None = None, *, blocks: int = BLOCKS, every: int = 1
    ) -> "Moments":
        """Sum a body's data, divided by what its channels read per motion.

        Args:
            data: of a body.
            reading: H of each channel, 1 for a good one; (n_freq, n_channel).
            blocks: of lines, in how many sums.
            every: take this many-th line only, for a first look.
        """
        patterns, group = np.unique(data.measured, axis=0, return_inverse=True)
        white, noise = data.white[:, ::every], data.noise[:, ::every]
        if reading is not None:
            white, noise = white / reading[::every], noise / np.abs(reading[::every]) ** 2
        starts = block_edges(white.shape[1], blocks)
        shape = (len(patterns), len(starts) - 1)
        gram = np.zeros((*shape, white.shape[2], white.shape[2]))
        total, count = np.zeros((*shape, white.shape[2])), np.zeros(shape)
        for column, g in enumerate(np.ravel(group)):
            for b, (first, last) in enumerate(pairwise(starts)):
                z, v = white[column, first:last], noise[column, first:last]
                parts = np.vstack([z.real, z.imag])
                gram[g, b] += parts.T @ parts
                total[g, b] += v.sum(axis=0)
                count[g, b] += (np.abs(z) > 0).any(axis=1).sum()
        keep = patterns.any(axis=1)
        return cls(patterns[keep], gram[keep], total[keep], count[keep])

    def of_blocks(self, blocks: Mask) -> "Moments":
        """Keep these blocks."""
        return Moments(
            self.mask, self.gram[:, blocks], self.noise[:, blocks], self.count[:, blocks]
        )

    def over(self, blocks: Mask | slice) -> "Moments":
        """Sum these blocks into one."""
        return Moments(
            self.mask,
            self.gram[:, blocks].sum(axis=1, keepdims=True),
            self.noise[:, blocks].sum(axis=1, keepdims=True),
            self.count[:, blocks].sum(axis=1, keepdims=True),
        )


def block_edges(lines: int, blocks: int = BLOCKS) -> Integers:
    """Where blocks of lines begin and end; (n_block + 1,)."""
    return np.linspace(0, lines, min(blocks, lines) + 1).astype(np.intp)


@dataclass(frozen=True, eq=False)
class Projection:
    """What rigid motion spans in a group's whitened channels.

    Args:
        spare: P; (n_channel, n_channel).
        inverse: B^+; (n_column, n_channel).
        rank: of B.
    """

    spare: Real
    inverse: Real
    rank: int


def project(rows: Real, mask: Mask) -> Projection:
    """Split channels into what rows span and what they leave spare.

    Args:
        rows: B; (n_channel, n_column).
        mask: channels that are there; (n_channel,).
    """
    rows = rows * mask[:, None]
    norm = np.linalg.norm(rows, axis=0)
    there = norm > _NOTHING * norm.max(initial=0.0)
    rows, norm = rows * there, np.where(there, norm, 1.0)
    left, values, right = np.linalg.svd(rows / norm, full_matrices=False)
    kept = int((values > _RANK * max(values[0], 1e-300)).sum())
    left, values, right = left[:, :kept], values[:kept], right[:kept]
    spare = np.diag(mask.astype(float)) - left @ left.T
    return Projection(spare, ((right.T / values) @ left.T) / norm[:, None], kept)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Errors that fit, what they leave and what they cost.

    Args:
        errors: p; (n_error,).
        data: tr(P (G - V)) [nats beyond noise].
        prior: half the sum of squares of p over its spread, released ones left out [nats].
        information: N of the last step, the data's part of the curvature; (n_error, n_error).
    """

    errors: Real
    data: float
    prior: float
    information: Real


@dataclass(frozen=True, eq=False)
class Model:
    """What a fit takes for granted.

    Args:
        sensors: drawn places and axes.
        scale: 1 / noise of each channel; (n_channel,).
        spread: one standard deviation of each error; (n_error,).
        extra: shapes of other motions whose amplitude is free, as columns; (n_channel, n).
    """

    sensors: Sensors
    scale: Real
    spread: Real
    extra: Real

    def rows(self, errors: Real) -> Real:
        """Rigid motions and the extra shapes; (n_channel, 6 + n)."""
        return np.hstack([self.sensors.rows(errors), self.extra])

    def data(self, moments: Moments, errors: Real) -> float:
        """tr(P (G - V)), over all groups and blocks of the moments."""
        rows = self.rows(errors) * self.scale[:, None]
        total = 0.0
        for mask, gram, noise in zip(moments.mask, moments.gram, moments.noise, strict=True):
            spare = project(rows, mask).spare
            total += float(np.sum(spare * gram.sum(axis=0)) - np.diag(spare) @ noise.sum(axis=0))
        return total

    def slopes(self, moments: Moments, errors: Real) -> tuple[Real, Real]:
        """Gradient of ``data`` (n_error,) and N, half its curvature (Gauss and Newton)."""
        rows = self.rows(errors) * self.scale[:, None]
        slopes = self.sensors.slopes(errors) * self.scale[:, None]
        gradient = np.zeros(len(slopes))
        information = np.zeros((len(slopes), len(slopes)))
        for mask, gram, noise in zip(moments.mask, moments.gram, moments.noise, strict=True):
            clean = gram.sum(axis=0) - np.diag(noise.sum(axis=0))
            split = project(rows, mask)
            inverse = split.inverse[:6]
            values, vectors = np.linalg.eigh(inverse @ clean @ inverse.T)
            root = vectors * np.sqrt(np.maximum(values, 0))
            moved = np.einsum("cd,pdq->pcq", split.spare, slopes) @ root
            flat = moved.reshape(len(slopes), -1)
            information += flat @ flat.T
            gradient -= 2 * np.einsum("pcq,qc->p", slopes, inverse @ clean @ split.spare)
        return gradient, information


def fit(
    model: Model, moments: Moments, *, start: Real | None = None, steps: int = _STEPS
) -> Fitted:
    """Least cost over the errors: data + p^2 / (2 spread^2), by damped Gauss and Newton."""
    precision = 1 / model.spread**2
    errors = np.zeros(model.sensors.count) if start is None else start
    data, prior = model.data(moments, errors), 0.5 * float(precision @ errors**2)
    information = np.zeros((len(errors), len(errors)))
    for _ in range(steps):
        gradient, information = model.slopes(moments, errors)
        # In units of the spread the curvature is one and more, however wide a spread is.
        scaled = 2 * information * np.outer(model.spread, model.spread)
        slope = (gradient + precision * errors) * model.spread
        step = np.linalg.solve(scaled + np.eye(len(scaled)), slope)
        change = -np.asarray(step * model.spread, float)
        before = data + prior
        for _ in range(_HALVINGS):
            new = model.sensors.step(errors, change)
            new_data = model.data(moments, new)
            new_prior = 0.5 * float(precision @ new**2)
            if new_data + new_prior < before:
                errors, data, prior = new, new_data, new_prior
                break
            change = change / 2
        if before - data - prior < _DONE:
            break
    return Fitted(errors, data, prior, information)
