r"""Verdicts of a linearised test: draws of noise and tolerances, weighed as a diagnosis does it.

An effect of size d on a machine with tolerances x_0 of N(0, 1) and noise of variance 1 changes the
whitened FRFs by d r + J x_0 + n. Without bounds the best fit that does not know the effect shifts
the tolerances by x and leaves, along the effect,

    x = d f + xi,   Cov xi = 1 - C / 2,   C = N^-1 (its tolerances),   left = (d |e| + eps)^2,

where f and e belong to its signature and eps has N(0, 1/2). Each draw has its own shape: a vector
any direction, as signatures of vectors add up, another effect one of its drawn shapes. Held at its
bound b, the tolerance that is farthest beyond it raises the cost by

    pen = max_j (|x_j| - b)^2 / C_jj,

shifts the others, and so on until none is beyond. The fit with the effect gains g = left + pen(x) -
pen(x without d f). A fit with another effect F, in any of its shapes, gains the part of it that
(e, f_j / C_jj^1/2) has along (e_F, f_F,j / C_jj^1/2), where j is held, or that e has along e_F.

Tolerances are not held, and pen is 0, if they are chance (``weighing``). An effect that only shifts
tolerances is none if together they are no less probable than one outlier. Otherwise it is found if
it has half of the probability among all effects, "unexplained" and "none", whose gap is known to
the error of n values, and if it closes a fifth of the gap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.special import logsumexp

from truth.campaign.held_tolerances import hold_tolerances
from truth.campaign.signatures import Information, Signature, families, gram_matrix
from truth.campaign.weighing import Weighing
from truth.effects.effect import Vector
from truth.machine.station import Integer, Mask, Real
from truth.random_streams import stream

Family: TypeAlias = tuple[str, str, str]
_GRAM_RIDGE = 1e-9  # of the Gram matrix of a family's shapes, relative
_SAME_DIRECTION = 1e-6  # singular value of directions below which they are dependent, relative


@dataclass(frozen=True, eq=False)
class LinearFits:
    """Fits without and with an effect, in each draw.

    Args:
        gain: g [nats]; (n_draw,).
        rest: pen with the effect [nats]; (n_draw,).
        worst: tolerance that costs most at its bound, -1 if none is there; (n_draw,).
    """

    gain: Real
    rest: Real
    worst: Integer


@dataclass(frozen=True, eq=False)
class LinearVerdicts:
    """Draws of one test, which all effects share.

    Args:
        signatures: of all effects and places that compete.
        information: of the lines that a fit sees.
        weighing: how the diagnosis weighs fits.
        draws: number of machines.
        seed: of noise, tolerances and directions.
    """

    signatures: Sequence[Signature]
    information: Information
    weighing: Weighing
    draws: int = 240
    seed: int = 0
    _family_fits: dict[int, tuple[Integer, Real]] = field(default_factory=dict)

    @cached_property
    def gram(self) -> Real:
        """Gram matrix of the signatures [nats]; (n, n)."""
        return gram_matrix(self.signatures)

    @cached_property
    def families(self) -> list[tuple[Family, list[int]]]:
        """Effects, places and directions with the numbers of their signatures."""
        return list(families(self.signatures))

    @cached_property
    def covariance(self) -> Real:
        """C of the tolerances; (n_tolerance, n_tolerance)."""
        return self.information.covariance()

    @cached_property
    def followed(self) -> Real:
        """Tolerances that follow each signature, f; (n, n_tolerance)."""
        return np.array([effect.followed[self.information.bounded] for effect in self.signatures])

    @cached_property
    def shifts(self) -> Real:
        """Draws of xi; (n_draw, n_tolerance)."""
        values, vectors = np.linalg.eigh(np.eye(len(self.covariance)) - self.covariance / 2)
        # The symmetric root is one matrix, whatever the signs of its eigenvectors.
        root = vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        normal = stream(self.seed, "tolerances").standard_normal((self.draws, len(values)))
        shifts: Real = normal @ root
        return shifts

    @cached_property
    def noise(self) -> Real:
        """Normal draws along an effect, of rivals, of the gap, and of three tolerances."""
        return stream(self.seed, "noise").standard_normal((6, self.draws))

    @cached_property
    def limits(self) -> Real:
        """Shifts up to which the farthest tolerances are chance."""
        return self.weighing.limits_of_chance(len(self.covariance))

    def find(self, numbers: Sequence[int], sizes: Real) -> Mask:
        """Return whether an effect is found in each draw.

        Args:
            numbers: of the signatures of its family.
            sizes: in each draw; (n_draw,).
        """
        weighing, fits = self.weighing, self._fit(numbers, sizes)
        before = (fits.rest + fits.gain) / weighing.fitted_values
        after = fits.rest / weighing.fitted_values
        rivals = fits.gain[:, None] * (1 - self._rival_shares(numbers, fits.worst))
        left = np.sqrt(np.maximum(rivals, 0.0)) + self.noise[1][:, None] / np.sqrt(2)
        left = np.maximum(left, 0.0) ** 2 / weighing.fitted_values
        after_each = after[:, None] + np.insert(left, 0, 0.0, axis=1)
        hypotheses = len({family[:2] for family, _ in self.families})
        effect = self.signatures[numbers[0]]
        rivals_of = [row for _, row in self.families if self._is_rival(effect, row[0])]
        parameters = np.array([len(numbers), *map(len, rivals_of)])
        logs = weighing.weigh(before, after_each, hypotheses, parameters)
        gap = before + self.noise[2] / np.sqrt(weighing.values)
        rival_logs = np.column_stack([logs[:, 1:], np.zeros(len(gap)), weighing.weigh_nothing(gap)])
        is_probable = logs[:, 0] > logsumexp(rival_logs, axis=1)
        is_material = before - after >= weighing.min_closed * before
        is_found: Mask = is_probable & is_material & ~self._only_shifts(numbers, sizes)
        return is_found

    def gain(self, numbers: Sequence[int], sizes: Real) -> Real:
        """Return g of each draw [nats]; see ``find`` for the arguments."""
        return self._fit(numbers, sizes).gain

    def shares(self, number: int) -> Real:
        """Return the part of a signature that each family explains without bounds; (n_family,)."""
        members, inverse = self._fits_of_families(-1)
        slope = self.gram[number][members]
        explained = np.einsum("fi,fij,fj->f", slope, inverse, slope)
        return np.asarray(explained / max(float(self.gram[number, number]), 1e-300))

    def shapes(self, numbers: Sequence[int]) -> Real:
        """Return the weights of a family's signatures in each draw; (n_draw, n_signature)."""
        effects = [self.signatures[number].drawn for number in numbers]
        vectors = [effect.along for effect in effects if isinstance(effect, Vector)]
        if len(vectors) < len(effects):
            return np.eye(len(numbers))[np.arange(self.draws) % len(numbers)]
        _, sizes, rows = np.linalg.svd(np.array(vectors))
        basis = rows[: len(sizes)][sizes > _SAME_DIRECTION * sizes[0]]
        random = stream(self.seed, "directions").standard_normal((self.draws, rows.shape[1]))
        along = random @ basis.T @ basis  # projected, whatever the signs of the basis
        directions = along / np.linalg.norm(along, axis=1, keepdims=True)
        weights: Real = directions @ np.linalg.pinv(np.array(vectors), rcond=_SAME_DIRECTION)
        return weights

    def _fit(self, numbers: Sequence[int], sizes: Real) -> LinearFits:
        """Return the fits without and with an effect."""
        weights = self.shapes(numbers)
        gram = weights @ self.gram[numbers]
        power = np.einsum("di,di->d", gram[:, numbers], weights)
        strength = np.sqrt(np.maximum(power, 1e-300))
        along = sizes + self.noise[0] / (np.sqrt(2) * strength)
        followed = weights @ self.followed[numbers]
        shift = sizes[:, None] * followed + self.shifts
        is_held = ~self._is_chance(shift)
        cost, worst = hold_tolerances(shift * is_held[:, None], self.covariance)
        bare = (shift - along[:, None] * followed) * is_held[:, None]
        rest, _ = hold_tolerances(bare, self.covariance)
        gain = np.maximum((strength * along) ** 2 + cost - rest, 0.0)
        return LinearFits(gain, rest, worst)

    def _rival_shares(self, numbers: Sequence[int], worst: Integer) -> Real:
        """Return the part of the gain of an effect that each other one gains; (n_draw, n_family).

        Args:
            numbers: of the signatures of its family.
            worst: tolerance that is held, in each draw; -1 for none.
        """
        effect = self.signatures[numbers[0]]
        is_other = np.array([self._is_rival(effect, row[0]) for _, row in self.families])
        weights = self.shapes(numbers)
        gram, followed = weights @ self.gram[numbers], weights @ self.followed[numbers]
        power = np.einsum("di,di->d", gram[:, numbers], weights)
        shares = np.zeros((self.draws, len(self.families)))
        for tolerance in {-1, *worst.tolist()}:
            rows = np.flatnonzero((worst == tolerance) | (tolerance == -1))
            members, inverse = self._fits_of_families(tolerance)
            slope, whole = gram[rows][:, members], power[rows]
            if tolerance >= 0:
                multiplier = followed[rows, tolerance] / self.covariance[tolerance, tolerance]
                slope = slope + multiplier[:, None, None] * self.followed[members, tolerance]
                whole = whole + multiplier * followed[rows, tolerance]
            gains = np.einsum("dfi,fij,dfj->df", slope, inverse, slope)
            shares[rows] = np.maximum(shares[rows], gains / np.maximum(whole, 1e-300)[:, None])
        return shares[:, is_other]

    def _is_rival(self, effect: Signature, number: int) -> bool:
        """Return whether a signature is of another effect or place that may be in its stead.

        An effect that is there or not has one size, at which one of any size is not looked for.
        """
        rival = self.signatures[number]
        has_size = [signature.drawn.size is not None for signature in (effect, rival)]
        return rival.family[:2] != effect.family[:2] and has_size[0] == has_size[1]

    def _fits_of_families(self, tolerance: int) -> tuple[Integer, Real]:
        """Return members and inverse Gram matrix of each family with a tolerance held; -1: none."""
        if tolerance not in self._family_fits:
            size = max(len(row) for _, row in self.families)
            members = np.array([(row + row[:1] * size)[:size] for _, row in self.families])
            is_member = np.array([np.arange(size) < len(row) for _, row in self.families])
            gram = self.gram[members[:, :, None], members[:, None, :]]
            if tolerance >= 0:
                along_held = self.followed[members, tolerance]
                variance = self.covariance[tolerance, tolerance]
                gram = gram + along_held[:, :, None] * along_held[:, None, :] / variance
            scale = np.sqrt(np.einsum("fii->fi", gram))
            scale = np.where(is_member & (scale > 0), scale, np.inf)  # padding explains nothing
            unit = gram / scale[:, :, None] / scale[:, None, :] + _GRAM_RIDGE * np.eye(size)
            inverse = np.linalg.inv(unit) / scale[:, :, None] / scale[:, None, :]
            self._family_fits[tolerance] = members, inverse
        return self._family_fits[tolerance]

    def _is_chance(self, shift: Real) -> Mask:
        """Return whether tolerances may lie so far off by chance; (n_draw,)."""
        counts = (np.abs(shift)[:, :, None] > self.limits).sum(axis=1)
        chance: Mask = (counts <= np.arange(len(self.limits))).all(axis=1)
        return chance

    def _only_shifts(self, numbers: Sequence[int], sizes: Real) -> Mask:
        """Return whether an effect only shifts tolerances, by no more than an outlier."""
        shift = self.signatures[numbers[0]].shift
        if not shift.count:
            return np.zeros(len(sizes), bool)
        squares = (shift.per_size * sizes + self.noise[3]) ** 2
        squares = squares + (self.noise[4 : 3 + shift.count] ** 2).sum(axis=0)
        return self.weighing.is_outlier(squares, shift.count)
