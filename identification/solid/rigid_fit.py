"""Fit of sensor errors with all rigid motions projected out and tolerances as priors.

With z the whitened channels of a line and a hit, B(p) the whitened rows and x free,

    min_x |z - B x|^2 = z^H P z,   P = 1 - B B^+,

and its sum over lines and hits is tr(P G), G = sum Re(z z^H): a fit needs only one small matrix per
block of lines. Noise alone gives tr(P V), V its diagonal. So tr(P (G - V)) is not biased by noise,
however weights were chosen (errors in variables with known noise; Fuller 1987, ch. 2). One unit is
one nat: z has the density exp(-|z - B x|^2). Delays tau among the errors are removed from z first:
z^H P z becomes y^H P y with y = exp(i w tau) z, which ``DelayedSums`` sums.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from identification.solid.body_channels import BodyData
from identification.solid.delayed_sums import DelayedSums, band_sums
from identification.solid.sensor_errors import Sensors
from identification.words import Complex, Integers, Mask, Real

_MIN_COLUMN_NORM = 1e-9  # norm of a column over the largest below which it is rounding
_RIGID_RANK_TOLERANCE = 1e-6  # singular value over the largest below which a motion is undetermined
_MAX_FIT_STEPS = 8  # Gauss-Newton steps
_MAX_HALVINGS = 6  # halvings of a step that does not lower the cost
_MIN_DECREASE_NATS = 1e-2  # decrease of the cost below which a fit has converged [nats]
N_BLOCKS = 24  # blocks of lines of the cross-validation


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over lines and hits, per group of columns with equal channels and per block of lines.

    Args:
        mask: channels of each group; (n_group, n_channel).
        gram: sum Re(z z^H); (n_group, n_block, n_channel, n_channel).
        noise: its diagonal due to noise alone; (n_group, n_block, n_channel).
        count: number of values summed; (n_group, n_block).
        delayed: sums from which delays can be removed, in which case blocks stay apart; None if
            delays are no errors.
    """

    mask: Mask
    gram: Real
    noise: Real
    count: Real
    delayed: DelayedSums | None = None

    @classmethod
    def of(
        cls,
        data: BodyData,
        reading: Complex | None = None,
        *,
        blocks: int = N_BLOCKS,
        every: int = 1,
    ) -> "Moments":
        """Sum the data of a body, divided by the readings of its channels per motion.

        Args:
            data: channels of a body.
            reading: H of each channel, 1 for a healthy one; (n_freq, n_channel).
            blocks: number of blocks of lines.
            every: use every so many-th line only, for a screening.
        """
        patterns, group = np.unique(data.measured, axis=0, return_inverse=True)
        white, noise = data.white[:, ::every], data.noise[:, ::every]
        if reading is not None:
            white, noise = white / reading[::every], noise / np.abs(reading[::every]) ** 2
        has_delays = data.sensors.has_delays
        starts = block_edges(white.shape[1], N_BLOCKS if has_delays else blocks)
        shape = (len(patterns), len(starts) - 1)
        gram = np.zeros((*shape, white.shape[2], white.shape[2]))
        total, count = np.zeros((*shape, white.shape[2])), np.zeros(shape)
        np.add.at(total, np.ravel(group), np.add.reduceat(noise, starts[:-1], axis=1))
        used = (white != 0).any(axis=2)
        np.add.at(count, np.ravel(group), np.add.reduceat(used.astype(float), starts[:-1], axis=1))
        for column, g in enumerate(np.ravel(group)):
            for b, (first, last) in enumerate(pairwise(starts)):
                z = white[column, first:last]
                gram[g, b] += z.real.T @ z.real + z.imag.T @ z.imag
        keep = patterns.any(axis=1)
        delayed = None
        if has_delays:
            groups = [np.ravel(group) == g for g in np.flatnonzero(keep)]
            delayed = band_sums(data.freq_hz[::every], white, groups, starts)
        return cls(patterns[keep], gram[keep], total[keep], count[keep], delayed)

    def exchange_channels(self, order: Sequence[int], signs: Real) -> "Moments":
        """Return the sums in which channel k has the readings of channel ``order[k]``.

        Args:
            order: number of the channel whose readings each channel gets; n_channel.
            signs: factor of each channel, 1 or -1; (n_channel,).
        """
        pairs, factor = np.ix_(order, order), np.outer(signs, signs)
        delayed = self.delayed
        if delayed is not None:
            delayed = replace(delayed, sums=delayed.sums[..., pairs[0], pairs[1]] * factor)
        return Moments(
            self.mask[:, order],
            self.gram[..., pairs[0], pairs[1]] * factor,
            self.noise[..., order],
            self.count,
            delayed,
        )

    def select_blocks(self, blocks: Mask | slice) -> "Moments":
        """Return the sums of some blocks."""
        return Moments(
            self.mask,
            self.gram[:, blocks],
            self.noise[:, blocks],
            self.count[:, blocks],
            None if self.delayed is None else self.delayed.select_blocks(blocks),
        )

    def sum_blocks(self, blocks: Mask | slice) -> "Moments":
        """Return the sum of some blocks as one block, or side by side if delays are errors."""
        if self.delayed is not None:
            return self.select_blocks(blocks)
        return Moments(
            self.mask,
            self.gram[:, blocks].sum(axis=1, keepdims=True),
            self.noise[:, blocks].sum(axis=1, keepdims=True),
            self.count[:, blocks].sum(axis=1, keepdims=True),
        )

    def without_delays(self, delays: Real | None) -> "Moments":
        """Return the sums of readings without these delays [s]; None: delays are no errors."""
        if self.delayed is None or delays is None:
            return self
        return replace(self, gram=self.delayed.power(delays))


def block_edges(lines: int, blocks: int = N_BLOCKS) -> Integers:
    """Return the first lines of all blocks and the end of the last; (n_block + 1,)."""
    return np.linspace(0, lines, min(blocks, lines) + 1).astype(np.intp)


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection of a group's whitened channels on the span of rigid motions and off it.

    Args:
        residual_projector: P; (n_channel, n_channel).
        inverse: B^+; (n_column, n_channel).
        rank: rank of B.
    """

    residual_projector: Real
    inverse: Real
    rank: int


def project(rows: Real, mask: Mask) -> Projection:
    """Compute the projector off the span of rows, and their pseudo-inverse.

    Args:
        rows: B; (n_channel, n_column).
        mask: channels that were measured; (n_channel,).
    """
    rows = rows * mask[:, None]
    norm = np.linalg.norm(rows, axis=0)
    has_motion = norm > _MIN_COLUMN_NORM * norm.max(initial=0.0)
    rows, norm = rows * has_motion, np.where(has_motion, norm, 1.0)
    left, values, right = np.linalg.svd(rows / norm, full_matrices=False)
    kept = int((values > _RIGID_RANK_TOLERANCE * max(values[0], 1e-300)).sum())
    left, values, right = left[:, :kept], values[:kept], right[:kept]
    residual_projector = np.diag(mask.astype(float)) - left @ left.T
    return Projection(residual_projector, ((right.T / values) @ left.T) / norm[:, None], kept)


@dataclass(frozen=True, eq=False)
class FittedErrors:
    """Fitted errors of sensors and their cost.

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
class RigidFitModel:
    """Model of a body's channels: rigid motions, errors of sensors and free shapes.

    Args:
        sensors: nominal places and axes.
        scale: 1 / noise of each channel; (n_channel,).
        spread: prior standard deviation of each error; (n_error,).
        extra: shapes of other motions with free amplitude, as columns; (n_channel, n).
    """

    sensors: Sensors
    scale: Real
    spread: Real
    extra: Real

    def rows(self, errors: Real) -> Real:
        """Return rigid motions and extra shapes as columns; (n_channel, 6 + n)."""
        return np.hstack([self.sensors.rows(errors), self.extra])

    def data(self, moments: Moments, errors: Real) -> float:
        """Compute tr(P (G - V)) over all groups and blocks of the moments."""
        moments = moments.without_delays(self.sensors.delays(errors))
        rows = self.rows(errors) * self.scale[:, None]
        total = 0.0
        for mask, gram, noise in zip(moments.mask, moments.gram, moments.noise, strict=True):
            residual_projector = project(rows, mask).residual_projector
            total += float(
                np.sum(residual_projector * gram.sum(axis=0))
                - np.diag(residual_projector) @ noise.sum(axis=0)
            )
        return total

    def slopes(self, moments: Moments, errors: Real) -> tuple[Real, Real]:
        """Compute the gradient of ``data``, (n_error,), and N, half its Gauss-Newton curvature."""
        rows = self.rows(errors) * self.scale[:, None]
        slopes = self.sensors.slopes(errors) * self.scale[:, None]
        gradient = np.zeros(len(slopes))
        information = np.zeros((len(slopes), len(slopes)))
        delays = self.sensors.delays(errors)
        gram, first, second = moments.gram, None, None
        if moments.delayed is not None and delays is not None:
            gram, first, second = moments.delayed.remove(delays)
        for group, (mask, noise) in enumerate(zip(moments.mask, moments.noise, strict=True)):
            clean = gram[group].sum(axis=0) - np.diag(noise.sum(axis=0))
            projection = project(rows, mask)
            inverse = projection.inverse[:6]
            values, vectors = np.linalg.eigh(inverse @ clean @ inverse.T)
            root = vectors * np.sqrt(np.maximum(values, 0))
            mapped = np.einsum("cd,pdq->pcq", projection.residual_projector, slopes) @ root
            flat = mapped.reshape(len(slopes), -1)
            information += flat @ flat.T
            gradient -= 2 * np.einsum(
                "pcq,qc->p", slopes, inverse @ clean @ projection.residual_projector
            )
            if first is not None and second is not None:
                add_delay_slopes(
                    gradient,
                    information,
                    projection,
                    projection.residual_projector @ slopes,
                    (first[group].sum(axis=0), second[group].sum(axis=0)),
                )
        return gradient, information


def add_delay_slopes(
    gradient: Real,
    information: Real,
    projection: Projection,
    projected_slopes: Real,
    sums: tuple[Real, Real],
) -> None:
    """Add gradient and information of delays, which are the last errors, of one group.

    With A_q = P B_q B^+ of any other error q, the products of Jacobians are
    N_q,m = sum_c (A_q)_mc W1_mc and N_m,m' = P_mm' W2_mm', and the gradient is -2 sum_c P_mc W1_mc.

    Args:
        gradient: of all errors, changed in place; (n_error,).
        information: N of all errors, changed in place; (n_error, n_error).
        projection: P and B^+.
        projected_slopes: P B_q; (n_error, n_channel, 6).
        sums: W1 and W2; (n_channel, n_channel) each.
    """
    first, second = sums
    late = slice(len(gradient) - len(first), len(gradient))
    projector = projection.residual_projector
    gradient[late] -= 2 * (projector * first).sum(axis=1)
    crossed = ((projected_slopes @ projection.inverse[:6]) * first).sum(axis=2)
    information[:, late] += crossed
    information[late] += crossed.T
    information[late, late] += projector * second


def fit_errors(
    model: RigidFitModel,
    moments: Moments,
    *,
    start: Real | None = None,
    steps: int = _MAX_FIT_STEPS,
) -> FittedErrors:
    """Minimise the cost over the errors: data + p^2 / (2 spread^2), by damped Gauss-Newton steps.

    Args:
        model: sensors, priors and free shapes.
        moments: sums of the data.
        start: errors at the start, zero if None; (n_error,).
        steps: number of steps, at most.
    """
    precision = 1 / model.spread**2
    errors = np.zeros(model.sensors.count) if start is None else start
    data, prior = model.data(moments, errors), 0.5 * float(precision @ errors**2)
    information = np.zeros((len(errors), len(errors)))
    for _ in range(steps):
        gradient, information = model.slopes(moments, errors)
        # In units of the spread the curvature is at least one, so that the solution is stable.
        scaled = 2 * information * np.outer(model.spread, model.spread)
        slope = (gradient + precision * errors) * model.spread
        step = np.linalg.solve(scaled + np.eye(len(scaled)), slope)
        change = -np.asarray(step * model.spread, float)
        before = data + prior
        for _ in range(_MAX_HALVINGS):
            trial = model.sensors.step(errors, change)
            trial_data = model.data(moments, trial)
            trial_prior = 0.5 * float(precision @ trial**2)
            if trial_data + trial_prior < before:
                errors, data, prior = trial, trial_data, trial_prior
                break
            change = change / 2
        if before - data - prior < _MIN_DECREASE_NATS:
            break
    return FittedErrors(errors, data, prior, information)
