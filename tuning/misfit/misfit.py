r"""What tuning minimises: minus the logarithm of the posterior density, with exact derivatives.

    J(x) = sum |r|^2 / (var + a^2 |H_point|^2) + 1/2 sum x_prior^2

over all measured values, var = E|error|^2 (real plus imaginary part), x in standard deviations
where the drawing has a tolerance. The residual r is the difference H_model - H_measured, or at
first the logarithm of the ratio,

    r = |H_measured| log(H_model / H_measured),

the only one that found the same minimum from every start: of small errors it is the difference up
to a phase. a is the allowance: an error that the model may have anyway, relative to |H_point|, the
length of the measured vector of all directions at one point of one test. A sensor that is one
degree off reads 1.7 % of the motion along its other axes, however little moves along its own. A
large allowance makes all lines count alike, resonances and valleys; none leaves the noise to weigh
them.

The normal equations take d r = g dH with g = 1, or |H_measured| / H_model of the logarithm:

    gradient = 2 Re sum w conj(g dH) r,   N = 2 Re sum w |g|^2 conj(dH) dH,   w = 1 / (var + ..).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from identification.words import Campaign, Complex, Integers, Mask, Real
from mbmodel import Linearised, Model
from tuning.misfit.accumulation import Freed, Own, Probed, Runs, blocks_of
from tuning.misfit.batch import batches
from tuning.misfit.body_projection import View, views
from tuning.misfit.normal_equations import Arrow, Quadratic
from tuning.misfit.partition import shares
from tuning.misfit.reduction import Root, roots, weighed
from tuning.misfit.weights import Weighted, at_centres, weigh
from tuning.parametrisation.parametrisation import Freedom


@dataclass(frozen=True, eq=False)
class _Side:
    """What a linearised batch brings to the normal equations, summed over the tests of an input.

    Args:
        lines: the model at theta.
        values: sum w |r|^2; (n_freq,).
        curvature: sum w |g|^2, 1/2 where bodies are weighted; (n_freq, n_out, n_in).
        pull: sum w conj(g) r, complex; the same shape.
        roots: of the weights of bodies, if these count.
    """

    lines: Linearised
    values: Real
    curvature: Real
    pull: Complex
    roots: tuple[Root, ...]


class Misfit:
    """J over a campaign as a function of x.

    Args:
        model: machine and Parts.
        campaign: its lines are those that count.
        freedom: coordinates of the parameters.
        allowance: a, relative to the motion of each point.
        logarithmic: whether r is the logarithm of the ratio.
        at_bodies: whether the difference counts at the centres of mass, with the covariance of
            their reduction.
        counted: lines that count, all if None; (n_freq,).
        threads: that form the normal equations; the result does not depend on it.
    """

    def __init__(
        self,
        model: Model,
        campaign: Campaign,
        freedom: Freedom,
        *,
        allowance: float,
        logarithmic: bool = False,
        at_bodies: bool = False,
        counted: Mask | None = None,
        threads: int = 1,
    ) -> None:
        self.model, self.freedom = model, freedom
        self._logarithmic, self._threads = logarithmic, threads
        lines = np.ones(len(campaign.freq_hz), bool) if counted is None else counted
        self._terms = [
            weigh(batch, allowance, logarithmic, lines) for batch in batches(model, campaign)
        ]
        if at_bodies and not logarithmic:
            self._terms = [at_centres(term, campaign.layout) for term in self._terms]
        self.values = sum(term.values for term in self._terms)
        self._plan = shares(model, freedom, apart=not at_bodies)

    def prior(self, x: Real) -> float:
        """1/2 sum x_prior^2."""
        return 0.5 * float((x[self.freedom.has_prior] ** 2).sum())

    def __call__(self, x: Real) -> tuple[float, Real]:
        """J and dJ/dx, by the adjoint method; (n_x,)."""
        theta = self.freedom.theta(x)
        total, gradient = self.prior(x), np.zeros(len(theta))
        for term in self._terms:
            lines = term.batch.evaluator.at(theta)
            values, weighted, _ = self._residual(term, lines)
            total += float(values.sum())
            gradient += lines.gradient(2 * term.batch.spread(weighted), self.freedom.free)
        return total, self.freedom.collected(gradient, x) + self._pulled(x)

    def value(self, x: Real) -> float:
        """J alone."""
        theta = self.freedom.theta(x)
        found = (self._residual(t, t.batch.evaluator.at(theta))[0].sum() for t in self._terms)
        return self.prior(x) + float(sum(found))

    def squares(self, x: Real) -> Real:
        """|r|^2 / (var + ..) of each value that counts; (n_value,).

        Raises:
            ValueError: differences count at the centres of mass, or by their logarithm.
        """
        found = [(w * np.abs(off) ** 2)[w > 0] for w, off in self._differences(x)]
        return np.concatenate(found)

    def serial(self, x: Real, lags: Sequence[int], fitted: Mask) -> float | None:
        """What is left that neighbouring lines share: the mean of Re conj(u) u' over the values.

        u and u' are residuals over the noise, of lines so far apart, one of which the fit saw and
        one not. Of noise alone whose lines are independent the mean is zero, however large that
        is: what a fit follows of it has the opposite sign among lines that it saw, which share its
        smooth error, and the same among those that it did not see, but of one of each none. Of an
        error that is smooth along frequency it is the mean square. Beside a mode whose half-power
        width is less than some eight lines the error turns within the lags, and hides.

        Args:
            x: where; (n_x,).
            lags: in lines, which are evenly spaced.
            fitted: lines that the fit saw; (n_freq,).

        Returns:
            The mean over the lags; None where no two such lines are so far apart.

        Raises:
            ValueError: as of ``squares``.
        """
        shared, count = 0.0, 0
        for weight, off in self._differences(x):
            left = np.sqrt(weight) * off
            for lag in lags:
                one = np.flatnonzero(fitted[:-lag] != fitted[lag:])
                shared += float(np.vdot(left[one], left[one + lag]).real)
                count += int(((weight[one] > 0) & (weight[one + lag] > 0)).sum())
        return shared / count if count else None

    def normal(self, x: Real) -> Quadratic:
        """J, dJ/dx, and the normal equations of the data alone, without the prior."""
        return self.normals(x, None)[0]

    def normals(self, x: Real, folds: Integers | None) -> list[Quadratic]:
        """The same of all lines, then of all lines but one fold, for each fold.

        Args:
            x: where; (n_x,).
            folds: of each line, from 0; (n_freq,).
        """
        theta = self.freedom.theta(x)
        sums: list[Quadratic] = []
        for term in self._terms:
            lines = term.batch.evaluator.at(theta)
            groups = np.zeros(len(lines.values), int) if folds is None else folds
            found = self._quadratics(term, lines, x, groups)
            sums = [_plus(*pair) for pair in zip(sums, found, strict=True)] if sums else found
        if not sums:
            raise ValueError("a campaign without tests has no normal equations")
        value, gradient, normal = reduce(_plus, sums)
        whole = value + self.prior(x), gradient + self._pulled(x), normal
        return [whole] if folds is None else [whole, *(_minus(whole, fold) for fold in sums)]

    def probed(self, x: Real, probes: Freedom) -> Probed:
        """How further coordinates bear on what varies; they are not asked about each other.

        Args:
            x: where; (n_x,).
            probes: of the same model, with nothing that varies here.
        """
        theta = self.freedom.theta(x)
        _, gradient, normal = self.normal(x)
        size = probes.size
        found = Probed(
            gradient,
            normal,
            np.zeros((self.freedom.size, size)),
            np.zeros((size, size)),
            np.zeros(size),
        )
        plan = shares(self.model, probes, apart=False)
        zero = np.zeros(size)
        for term in self._terms:
            side = self._side(term, term.batch.evaluator.at(theta))
            forward = side.lines.forward(plan.shared, probes.rates(zero))
            runs = self._runs(side, x, whole=forward.reads)
            runs.probe(Runs(plan, forward, runs.views), blocks_of(self.model, probes), found)
        return found

    def freed(self, x: Real, forces: Real, power: float, found: Freed) -> None:
        """Add up what forces of free spectra take from the normal equations, each alone.

        Args:
            x: where; (n_x,).
            forces: at the joints' coordinates; (nv, n_force).
            power: variance of each, relative to the answer of the median line.
            found: sums.
        """
        theta = self.freedom.theta(x)
        for term in self._terms:
            side = self._side(term, term.batch.evaluator.at(theta))
            self._runs(side, x).freed(forces, power, found)

    def _differences(self, x: Real) -> Iterator[tuple[Real, Complex]]:
        """Weights and differences of each batch; (n_freq, n_out, n_test)."""
        if self._logarithmic or any(term.mixed is not None for term in self._terms):
            raise ValueError("squares of values are those of differences at the channels")
        theta = self.freedom.theta(x)
        for term in self._terms:
            batch = term.batch
            yield term.weight, batch.pick(batch.evaluator.at(theta).values) - batch.values

    def _pulled(self, x: Real) -> Real:
        """Gradient of the prior."""
        pulled: Real = np.where(self.freedom.has_prior, x, 0.0)
        return pulled

    def _residual(self, term: Weighted, lines: Linearised) -> tuple[Real, Complex, Real]:
        """Sum w |r|^2 of each line; w conj(g) r and w |g|^2, (n_freq, n_out, n_test)."""
        batch, weight = term.batch, term.weight
        model = batch.pick(lines.values)
        if not self._logarithmic:
            off = model - batch.values
            pull = weight * off if term.mixed is None else weighed(term.mixed, off)
            return _power(off, pull), pull, weight
        model = np.where(weight > 0, model, 1.0)
        product = model * np.where(weight > 0, batch.values, 1.0).conj()
        off = np.log(np.abs(model)) - term.log_size + 1j * np.arctan2(product.imag, product.real)
        power = weight * np.abs(batch.values) ** 2
        pull = power * off / model.conj()
        return _power(off, power * off), pull, power / np.abs(model) ** 2

    def _quadratics(
        self, term: Weighted, lines: Linearised, x: Real, groups: Integers
    ) -> list[Quadratic]:
        """J, gradient and normal equations of the data of one batch, for each group of lines."""
        plan, freedom = self._plan, self.freedom
        side = self._side(term, lines)
        runs = self._runs(side, x)
        found: list[Quadratic] = []
        for group, sums in enumerate(runs.sums(groups, self._threads)):
            shared, slope, cross, blocks, own_slopes = sums
            gradient = np.zeros(freedom.size + 1)
            gradient[plan.own_at] = own_slopes
            gradient[plan.shared_at] = slope
            arrow = Arrow(shared, cross, blocks, plan.shared_at, plan.own_at)
            found.append((float(side.values[groups == group].sum()), gradient[:-1], arrow))
        return found

    def _side(self, term: Weighted, lines: Linearised) -> _Side:
        spread = term.batch.spread
        values, pull, curvature = self._residual(term, lines)
        side = _Side(lines, values, spread(curvature.astype(complex)).real, spread(pull), ())
        if term.mixed is not None:
            n_in = side.pull.shape[2]
            mixing = roots(term.mixed, term.batch.columns, n_in)
            half = np.zeros(side.pull.shape)
            for one in mixing:
                half[:, one.rows] = 0.5
            side = replace(side, curvature=half, roots=mixing)
        return side

    def _runs(self, side: _Side, x: Real, *, whole: bool = False) -> Runs:
        """Weighted derivatives of one batch; whether all channels count one by one."""
        plan, rates = self._plan, self.freedom.rates(x)
        root = np.sqrt(2 * side.curvature)
        aim = 2 * np.divide(
            side.pull, root, out=np.zeros(root.shape, complex), where=side.curvature > 0
        )
        for one in side.roots:
            aim[:, one.rows] = np.einsum("ftij,fjt->fit", one.inverse, aim[:, one.rows])
        forward = side.lines.forward(plan.shared, rates)
        seen = views(side.lines.places.readout, root, aim, side.roots, whole=whole or forward.reads)
        sensors = side.lines.forward(plan.of_sensors)
        own = (
            _own(rows, values, root, aim, seen)
            for rows, values, _ in plan.own_columns(sensors, rates)
        )
        return Runs(plan, forward, seen, tuple(own))


@dataclass(frozen=True, eq=False)
class Sparse:
    """A misfit whose normal equations come from every so manyth of its lines.

    Bandwidths are wider than a line: lines that are left out look like those that count, and the
    gradient, which is that of all lines, alone says where the end is.

    Args:
        whole: the misfit.
        few: of the lines that count for N.
        ratio: how many times as many there are.
    """

    whole: Misfit
    few: Misfit
    ratio: float

    def __call__(self, x: Real) -> tuple[float, Real]:
        """J and dJ/dx."""
        return self.whole(x)

    def value(self, x: Real) -> float:
        """J."""
        return self.whole.value(x)

    def normal(self, x: Real) -> Quadratic:
        """J, dJ/dx, and the normal equations of few lines for all of them."""
        return (*self.whole(x), self.few.normal(x)[2] * self.ratio)


def _own(rows: Integers, values: Complex, root: Real, aim: Complex, seen: tuple[View, ...]) -> Own:
    """What a sensor's own coordinates move, its derivatives (n_freq, n_row, n_in, n_own)."""
    number = next(k for k, view in enumerate(seen) if np.isin(rows, view.rows).all())
    view = seen[number]
    bare = _split(values)
    matrix = view.matrix[..., np.searchsorted(view.rows, rows)][:, :, None]
    weight = root[:, rows].transpose(0, 2, 1)[:, :, None, :, None]
    return Own(number, matrix @ bare, weight * bare, _split(aim[:, rows, :, None])[..., 0])


def _split(values: Complex) -> Real:
    """Real and imaginary parts, (n_freq, n_row, n_in, n) to (n_freq, n_in, 2, n_row, n)."""
    return np.stack([values.real, values.imag]).transpose(1, 3, 0, 2, 4)


def _plus(one: Quadratic, other: Quadratic) -> Quadratic:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _minus(one: Quadratic, other: Quadratic) -> Quadratic:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def _power(one: Complex, other: Complex) -> Real:
    """Real part of the sum of conj(one) other over each line; (n_freq,)."""
    found: Real = np.einsum("fit,fit->f", one.conj(), other).real
    return found
