"""Misfit that tuning minimises: minus the log posterior density, with exact derivatives.

    J(x) = sum |r|^2 / (var + a^2 |H_point|^2) + 1/2 sum x_prior^2

The first sum runs over all measured values, with var = E|error|^2 (real plus imaginary part); the
second over the coordinates with a prior, in standard deviations. The minimum of J is the maximum a
posteriori estimate. The residual r is the difference H_model - H_measured, or in the first stages
the logarithm of the ratio,

    r = |H_measured| log(H_model / H_measured),

the only residual that led to one minimum from every start. For small errors it equals the
difference up to a phase.

a is the model-error floor: the relative model error that the fit tolerates. It is relative to
|H_point|, the length of the vector of all directions measured at one point of one test. A sensor
with one degree of misalignment reads 1.7 % of the motion along its other axes, even if there is
little motion along its own. With a large floor all lines count alike, resonances and valleys;
without a floor the noise alone weights them. Stages lower it step by step (continuation).

The normal equations are the Gauss-Newton approximation of the Hessian. They follow from
d r = g dH, with g = 1, or g = |H_measured| / H_model for the logarithm:

    gradient = 2 Re sum w conj(g dH) r,   N = 2 Re sum w |g|^2 conj(dH) dH,   w = 1 / (var + ..).
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, reduce

import numpy as np

from identification.words import Campaign, Complex, Integers, Mask, Real
from mbmodel import Linearised, Model
from tuning.misfit.accumulation import FreeForceReduction, WeightedJacobian
from tuning.misfit.batch import batch_tests
from tuning.misfit.batch_derivatives import BatchSums, compute_jacobian, compute_residual, sum_batch
from tuning.misfit.normal_equations import ArrowMatrix, QuadraticModel
from tuning.misfit.partition import CoordinatePartition, partition_coordinates
from tuning.misfit.probing import ProbedEquations, probe_blocks, probe_by_columns, probe_by_forces
from tuning.misfit.weights import WeightedBatch, weight_at_bodies, weight_batch
from tuning.parametrisation.parametrisation import Parametrisation

_VALUES_TOGETHER = 2**16  # of differences: what a cache holds


class Misfit:
    """J of a campaign as a function of x.

    Args:
        campaign: tests on the lines that count.
        model_error_floor: a, relative to the motion of each point.
        logarithmic: whether r is the logarithm of the ratio.
        at_bodies: whether differences count at the centres of mass, with the covariance of their
            reduction.
        counted: whether each line counts, all if None; (n_freq,).
        threads: threads that form the normal equations; the result does not depend on them.

    Attributes:
        values: number of measured values that count.
    """

    def __init__(
        self,
        model: Model,
        campaign: Campaign,
        parametrisation: Parametrisation,
        *,
        model_error_floor: float,
        logarithmic: bool = False,
        at_bodies: bool = False,
        counted: Mask | None = None,
        threads: int = 1,
    ) -> None:
        self.model, self.parametrisation = model, parametrisation
        self._logarithmic, self._threads = logarithmic, threads
        lines = np.ones(len(campaign.freq_hz), bool) if counted is None else counted
        self._terms = [
            weight_batch(batch, model_error_floor, logarithmic, lines)
            for batch in batch_tests(model, campaign)
        ]
        if at_bodies and not logarithmic:
            self._terms = [weight_at_bodies(term, campaign.layout) for term in self._terms]
        self.values = sum(term.values for term in self._terms)
        self._at_bodies = at_bodies
        self._linearised: tuple[tuple[Real, tuple[Linearised, ...]], ...] = ()

    @cached_property
    def _partition(self) -> CoordinatePartition:
        """Shared coordinates, and blocks of sensors."""
        return partition_coordinates(
            self.model, self.parametrisation, separate_channels=not self._at_bodies
        )

    @property
    def batches(self) -> tuple[WeightedBatch, ...]:
        """Batches of tests with the weights of their values."""
        return tuple(self._terms)

    def with_weights(self, weights: Sequence[Real]) -> "Misfit":
        """Return the misfit with other weights of its values.

        Args:
            weights: w of the values of each batch, zero where one does not count;
                (n_freq, n_out, n_test) each.

        Raises:
            ValueError: the misfit has weights at the centres of mass.
        """
        if any(term.body_weights is not None for term in self._terms):
            raise ValueError("channels cannot be weighted beside weights at the centres of mass")
        misfit = copy(self)
        misfit._terms = [
            replace(term, weight=weight) for term, weight in zip(self._terms, weights, strict=True)
        ]
        return misfit

    def prior(self, x: Real) -> float:
        """Return 1/2 sum d x^2, d being the precision of the prior [nats]."""
        return 0.5 * float(x @ (self.parametrisation.precision * x))

    def __call__(self, x: Real) -> tuple[float, Real]:
        """Return J [nats] and dJ/dx, by the adjoint method; (n_x,)."""
        theta = self.parametrisation.theta(x)
        total, gradient = self.prior(x), np.zeros(len(theta))
        for term, lines in self._linearise(theta):
            values, weighted, _ = compute_residual(term, lines, logarithmic=self._logarithmic)
            total += float(values.sum())
            gradient += lines.gradient(
                2 * term.batch.sum_by_input(weighted), self.parametrisation.free
            )
        return total, self.parametrisation.gradient_by_coordinates(
            gradient, x
        ) + self._prior_gradient(x)

    def value(self, x: Real) -> float:
        """Return J [nats]."""
        theta = self.parametrisation.theta(x)
        data = (
            compute_residual(term, lines, logarithmic=self._logarithmic)[0].sum()
            for term, lines in self._linearise(theta)
        )
        return self.prior(x) + float(sum(data))

    def squared_residuals(self, x: Real) -> Real:
        """Return |r|^2 / (var + ..) of each value that counts; (n_value,).

        Raises:
            ValueError: the misfit uses logarithms, or weights at the centres of mass.
        """
        by_batch = [
            (weight * np.abs(difference) ** 2)[weight > 0]
            for weight, difference in self._differences(x)
        ]
        return np.concatenate(by_batch)

    def unit_residuals(self, x: Real) -> Iterator[Complex]:
        """Yield the residuals of each batch over their deviations; (n_freq, n_out, n_test)."""
        for weight, difference in self._differences(x):
            yield np.sqrt(weight) * difference

    def serial_covariance(self, x: Real, lags: Sequence[int], fitted: Mask) -> float | None:
        """Return the covariance of residuals of neighbouring lines, one fitted and one held out.

        It is the mean of Re conj(u) u' over the values. The residuals u and u', in units of their
        standard deviation, belong to two lines that lie a lag apart, one of which the fit saw. If
        lines are independent, noise alone gives a mean of zero, whatever its size. The part of
        noise that a fit follows has a negative covariance among fitted lines and a positive one
        among held-out lines, but none between the two. A model error that is smooth along
        frequency gives its mean square. Beside a mode whose half-power width is less than some
        eight lines, the error turns within the lags and is missed.

        Args:
            x: coordinates; (n_x,).
            lags: distances [lines]; lines are evenly spaced.
            fitted: whether the fit saw each line; (n_freq,).

        Returns:
            The mean over all lags; None if no pair of lines has such a distance.

        Raises:
            ValueError: the misfit uses logarithms, or weights at the centres of mass.
        """
        shared, count = 0.0, 0
        firsts = [np.flatnonzero(fitted[:-lag] != fitted[lag:]) for lag in lags]
        for weight, difference in self._differences(x, _VALUES_TOGETHER):
            along_frequency = weight.transpose(1, 2, 0)
            is_read = (along_frequency > 0).any(axis=2)
            read_weight = along_frequency[is_read]
            residual = np.sqrt(read_weight) * difference.transpose(1, 2, 0)[is_read]
            counts = read_weight > 0
            for lag, first in zip(lags, firsts, strict=True):
                shared += float(np.vdot(residual[:, first], residual[:, first + lag]).real)
                count += int((counts[:, first] & counts[:, first + lag]).sum())
        return shared / count if count else None

    def quadratic_model(self, x: Real) -> QuadraticModel:
        """Return J, dJ/dx, and the normal equations of the data, without the prior."""
        return self.quadratic_models_by_fold(x, None)[0]

    def quadratic_models_by_fold(self, x: Real, folds: Integers | None) -> list[QuadraticModel]:
        """Return quadratic models of all lines, then of all lines but one fold, for each fold.

        Args:
            x: coordinates; (n_x,).
            folds: fold of each line, from 0, or None for no folds; (n_freq,).

        Raises:
            ValueError: the campaign has no tests.
        """
        sums: list[QuadraticModel] = []
        for parts in self._weighted_jacobians(x):
            of_folds = self._batch_quadratics(*parts, folds)
            sums = [_add(*pair) for pair in zip(sums, of_folds, strict=True)] if sums else of_folds
        if not sums:
            raise ValueError("the campaign has no tests, and thus no normal equations")
        value, gradient, normal = reduce(_add, sums)
        whole = value + self.prior(x), gradient + self._prior_gradient(x), normal
        return [whole] if folds is None else [whole, *(_subtract(whole, fold) for fold in sums)]

    def probe_coordinates(self, x: Real, probes: Parametrisation) -> ProbedEquations:
        """Return the normal equations with their coupling to further coordinates (probes).

        Couplings between the probes of different Parts are left out.

        Args:
            x: coordinates; (n_x,).
            probes: parametrisation of the same model, with nothing that varies here.
        """
        jacobians, size = list(self._weighted_jacobians(x)), probes.size
        quadratics = (self._batch_quadratics(*parts, None)[0] for parts in jacobians)
        _, gradient, normal = reduce(_add, quadratics)
        probed = ProbedEquations(
            gradient + self._prior_gradient(x),
            normal,
            np.zeros((self.parametrisation.size, size)),
            np.zeros((size, size)),
            np.zeros(size),
        )
        partition = partition_coordinates(self.model, probes, separate_channels=False)
        numbers, rates = np.flatnonzero(partition.shared_parameters), probes.rates(np.zeros(size))
        parts = probe_blocks(self.model, probes)
        for sums, of_bodies in jacobians:
            whole = sums.lines.sensitivities(partition.shared_parameters, rates)
            by_forces = whole.is_force_alone
            are_forces = bool(by_forces.all())
            jacobian = of_bodies if are_forces else self._jacobian(sums, x, all_channels=True)
            for by_force in (True, False):
                blocks = [part for part in parts if by_forces[part].all() == by_force]
                if not blocks:
                    continue
                chosen = np.zeros(len(partition.shared_parameters), bool)
                chosen[numbers[np.concatenate(blocks)]] = True
                is_whole = len(blocks) == len(parts)
                forward = whole if is_whole else sums.lines.sensitivities(chosen, rates)
                if by_force:
                    probe_by_forces(jacobian, forward, blocks, probed)
                else:
                    some = replace(partition, shared_parameters=chosen)
                    columns = WeightedJacobian(some, forward, jacobian.projections)
                    probe_by_columns(jacobian, columns, blocks, probed)
        return probed

    def add_force_reduction(
        self, x: Real, forces: Real, powers: Real, reduction: FreeForceReduction
    ) -> None:
        """Add the reduction of the normal equations by forces of free spectra, one at a time.

        Args:
            x: coordinates; (n_x,).
            forces: generalised forces at the joints' coordinates; (nv, n_force).
            powers: variance of each force, relative to its response on the median line; (n_force,).
            reduction: sums to which to add.
        """
        for _, jacobian in self._weighted_jacobians(x):
            jacobian.add_force_reduction(forces, powers, reduction)

    def force_gains(self, x: Real, forces: Real, powers: Real) -> Real:
        """Return the gains of forces of free spectra, one at a time, if nothing else varies.

        Args:
            x: coordinates; (n_x,).
            forces: generalised forces at the joints' coordinates; (nv, n_force).
            powers: variance of a force, relative to its response on the median line; (n_power,).

        Returns:
            (n_power, n_force) [nats].
        """
        gains = np.zeros((len(powers), forces.shape[1]))
        for _, jacobian in self._weighted_jacobians(x):
            gains += jacobian.force_gains(forces, powers)
        return gains

    def _differences(
        self, x: Real, max_values: int | None = None
    ) -> Iterator[tuple[Real, Complex]]:
        """Yield weights and differences of the channels of each batch; (n_freq, n_out, n_test).

        Args:
            max_values: number of values from which channels are split; None for all together.
        """
        if self._logarithmic or any(term.body_weights is not None for term in self._terms):
            raise ValueError(
                "squared residuals exist for differences at the channels only: "
                "use a misfit without logarithm and without weights at bodies"
            )
        theta = self.parametrisation.theta(x)
        for term, lines in self._linearise(theta):
            batch, n_out = term.batch, term.weight.shape[1]
            step = n_out
            if max_values is not None:
                step = max(1, n_out * max_values // max(1, term.weight.size))
            for first in range(0, n_out, step):
                rows = slice(first, first + step)
                model = batch.select_inputs(lines.values[:, rows])
                yield term.weight[:, rows], model - batch.values[:, rows]

    def _linearise(self, theta: Real) -> Iterator[tuple[WeightedBatch, Linearised]]:
        """Return the batches with the model linearised at theta.

        The last two models are kept: a search asks for J, and then for the derivatives there.
        """
        for kept, models in self._linearised:
            if np.array_equal(kept, theta):
                return zip(self._terms, models, strict=True)
        models = tuple(term.batch.evaluator.at(theta) for term in self._terms)
        self._linearised = ((theta, models), *self._linearised[:1])
        return zip(self._terms, models, strict=True)

    def _prior_gradient(self, x: Real) -> Real:
        """Return the gradient of the prior; (n_x,)."""
        return self.parametrisation.precision * x

    def _jacobian(
        self, sums: BatchSums, x: Real, *, all_channels: bool = False
    ) -> WeightedJacobian:
        """Return the weighted derivatives of one batch."""
        rates = self.parametrisation.rates(x)
        return compute_jacobian(sums, self._partition, rates, all_channels=all_channels)

    def _weighted_jacobians(self, x: Real) -> Iterator[tuple[BatchSums, WeightedJacobian]]:
        """Yield residuals, weights and weighted derivatives of each batch."""
        for term, lines in self._linearise(self.parametrisation.theta(x)):
            sums = sum_batch(term, lines, logarithmic=self._logarithmic)
            yield sums, self._jacobian(sums, x)

    def _batch_quadratics(
        self, sums: BatchSums, jacobian: WeightedJacobian, folds: Integers | None
    ) -> list[QuadraticModel]:
        """Return the quadratic model of one batch's data for each fold of lines; one for None."""
        partition, parametrisation = self._partition, self.parametrisation
        groups = np.zeros(len(sums.values), int) if folds is None else folds
        quadratics: list[QuadraticModel] = []
        for group, group_sums in enumerate(jacobian.sums(groups, self._threads)):
            shared, slope, cross, blocks, block_slopes = group_sums
            gradient = np.zeros(parametrisation.size + 1)
            gradient[partition.block_coordinates] = block_slopes
            gradient[partition.shared_coordinates] = slope
            arrow = ArrowMatrix(
                shared, cross, blocks, partition.shared_coordinates, partition.block_coordinates
            )
            quadratics.append((float(sums.values[groups == group].sum()), gradient[:-1], arrow))
        return quadratics


def _add(first: QuadraticModel, second: QuadraticModel) -> QuadraticModel:
    """Return the sum of two quadratic models."""
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


def _subtract(first: QuadraticModel, second: QuadraticModel) -> QuadraticModel:
    """Return the difference of two quadratic models."""
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]
