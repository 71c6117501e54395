r"""Stiffness that a law adds in each test, by its parameters, and the average of scattered hits.

No two hits are alike: H1 is the average of what all hits of a test show, each weighted by the power
of its force. With kappa_i the joint's stiffness under hit i and h_g the joint's own receptance, a
hit of force F_i shows (``joint_update``)

    H_i = H_0 - h_o h_i c_i,   c_i = kappa_i / (1 + kappa_i h_g),

so that the average over hits has the stiffness

    kappa = c / (1 - c h_g),   c = sum |F_i|^2 c_i / sum |F_i|^2,

exactly. Records tell the momenta of the hits; without them the logarithm of a hit's size is taken
as normal. A few equally probable sizes stand for all. The average is taken as linear in the
variance, which FRFs tell and the refit therefore fits.

The motion that sets kappa depends on the joint's linear spring and damper, which are fitted with
the law. The table follows both: a fit that took kappa as it was would trade the law against them,
and would end where the true slope is not zero.

A single hit shows a rough function of the parameters of a law: where its decaying motion touches a
stop or slides for the last time changes by jumps. Several sizes smooth it, as many hits of a test
do, the more of them the better: with four sizes a refit of a gap stopped on its way down a valley.
Laws that are less rough need fewer.

The stiffness in the middle of a cell is that of all places at which it is simulated: of a linear
function on a symmetric design, their mean is the least-squares estimate (Box, Hunter and Hunter
2005, ch. 10).
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from identification.words import Complex, Mask, Real


@dataclass(frozen=True, eq=False)
class LawTable:
    """Stiffness that a law adds on every line of every test, and its derivatives.

    It is linear in cells of the parameters, which are logarithms of sizes: within a cell by the
    central differences between its ends, since simulations are expensive. The start is the middle
    of a cell. Hits of another peak are those of the estimated one on a similar law: all motion
    scales with them if the length or force of the law does (``LawFamily.similarity``).

    Args:
        joint: linear machine and hits.
        start: where a refit begins: parameters of the law, values of the joint's linear spring or
            damper that it follows, relative duration; (n_parameter,).
        followed: which of "stiffness" and "damping" stand there beside the parameters of the law.
        known: results in the last cells.
        latest: the last parameters and their results: the Parts of all tests ask for them.
    """

    joint: TestedJoint
    family: LawFamily
    start: tuple[float, ...]
    followed: tuple[str, ...] = ()
    known: dict[bytes, tuple[Complex, Complex]] = field(default_factory=dict)
    latest: dict[bytes, tuple[Complex, Complex]] = field(default_factory=dict)

    def at(self, theta: Real) -> tuple[Complex, Complex]:
        """Return kappa at the estimated peaks (n_test, n_freq), and its derivatives.

        Args:
            theta: parameters as in ``start``, then the relative variance of hits.

        Returns:
            kappa, and its derivatives by theta, then by the logarithm of each test's peak;
            (n_parameter + 1, n_test, n_freq).
        """
        key = theta.tobytes()
        kept = self.latest.get(key)
        if kept is not None:
            return kept
        place, variance = self._coordinates(theta[:-1]) - self._origin, float(theta[-1])
        size = 2 * self._steps
        cell = np.rint(place / size) + 0.0  # no -0.0, whose bytes differ
        mean, slopes = self._simulate_cell(cell, self._origin + size * cell)
        inside = np.append(place - size * cell, variance)
        kappa = mean + np.tensordot(inside, slopes[:-1], axes=1)
        by_theta = np.append(np.where(self._is_size, theta[:-1], 1.0), [1.0, 1.0])
        result = kappa, slopes / by_theta[:, None, None]
        self.latest.clear()
        self.latest[key] = result
        return result

    @property
    def _is_size(self) -> Mask:
        """Which parameters are positive sizes; those of all joints and hits are; (n_parameter,)."""
        return np.array([*self.family.is_size, *(True for _ in self.followed), True])

    @cached_property
    def _steps(self) -> Real:
        """Steps of difference quotients by each coordinate; (n_parameter,)."""
        names = *(name for name, _ in self.family.parameters), *self.followed, "duration"
        chosen, is_rough = LEVEL_SETTINGS, self.family.is_rough
        linear = chosen.rough_linear_step if is_rough else chosen.linear_step
        return np.array(
            [linear if name == "stiffness" else chosen.difference_step for name in names]
        )

    @cached_property
    def _origin(self) -> Real:
        """Coordinates of the start; (n_parameter,)."""
        return self._coordinates(np.array(self.start))

    @cached_property
    def _receptance(self) -> Complex:
        """h_g of the linear machine; (n_freq,)."""
        receptance: Complex = self.joint.transient().receptances(self.joint.freq_hz)[:, 0]
        return receptance

    def _read_linear(self, place: Real) -> Real:
        """Return stiffness and damping of the joint's linear spring and damper; (2,)."""
        count = len(self.family.parameters)
        values = {"stiffness": self.joint.stiffness, "damping": self.joint.damping}
        if self.family.follows_stiffness:
            values["stiffness"] = float(place[count - 1])
        values |= zip(self.followed, place[count:-1].tolist(), strict=True)
        return np.array([values["stiffness"], values["damping"]])

    def _compute_receptances(self, springs: Real) -> Complex:
        """Return h_g of the machine with each linear spring and damper; (n_case, n_freq).

        Args:
            springs: stiffness and damping of each; (n_case, 2).
        """
        stiffness, damping = (springs - (self.joint.stiffness, self.joint.damping)).T[:, :, None]
        added = stiffness + 2j * np.pi * self.joint.freq_hz * damping
        receptances: Complex = self._receptance / (1 + added * self._receptance)
        return receptances

    def _coordinates(self, theta: Real) -> Real:
        """Return logarithms of sizes, other parameters as they are; (n_parameter,)."""
        sizes = np.where(self._is_size, theta, 1.0)
        return np.where(self._is_size, np.log(sizes), theta)

    def _simulate_cell(self, cell: Real, place: Real) -> tuple[Complex, Complex]:
        """Return kappa of the mean hit in the middle of a cell, and its derivatives.

        Derivatives are those of the average by the coordinates, by the variance, and by the
        logarithm of the peaks; (n_parameter + 1, n_test, n_freq).

        Args:
            cell: its numbers, by which it is kept; (n_parameter,).
            place: coordinates of its middle; (n_parameter,).
        """
        key = cell.tobytes()
        kept = self.known.get(key)
        if kept is not None:
            return kept
        chosen = LEVEL_SETTINGS
        count = chosen.rough_hit_sizes if self.family.is_rough else chosen.hit_sizes
        sizes = self.joint.list_hit_sizes(count)
        moves = np.diag(self._steps)
        places = np.array([place, *(place + moves), *(place - moves)])
        places = np.where(self._is_size, np.exp(places), places)
        springs = np.array([self._read_linear(theta) for theta in places])
        cases = [
            (theta, size, linear)
            for theta, linear in zip(places, springs, strict=True)
            for size in (np.ones(sizes.shape[1]), *sizes)
        ]
        kappas = self.joint.compute_stiffness(self.family, cases)
        kappas = kappas.reshape(len(places), 1 + len(sizes), *kappas.shape[1:])
        mean, scattered = kappas[:, 0], kappas[:, 1:]
        weights = sizes[:, self.joint.group_equal_hits()] ** 2
        with np.errstate(invalid="ignore"):  # a spring that gives way has no stiffness
            averages = average_hits(scattered, self._compute_receptances(springs), weights)
            after, before = np.split(averages[1:], 2)
            by_variance = (averages - mean).mean(axis=0)
            by_place = (after - before) / (2 * self._steps[:, None, None])
            number, power = self.family.similarity
            slopes = [*by_place, by_variance, power * by_place[number]]
        for oldest in list(self.known)[: -LEVEL_SETTINGS.kept_cells]:
            self.known.pop(oldest, None)
        self.known[key] = mean.mean(axis=0), np.array(slopes)
        return self.known[key]


def average_hits(stiffness: Complex, receptance: Complex, weights: Real) -> Complex:
    """Return the stiffness that H1 of several hits shows; (n_case, n_test, n_freq).

    Args:
        stiffness: kappa under each hit; (n_case, n_hit, n_test, n_freq).
        receptance: h_g in each case; (n_case, n_freq).
        weights: of each hit, its number times the power of its force; (n_hit, n_test).
    """
    shown = stiffness / (1 + stiffness * receptance[:, None, None])
    mean = np.einsum("ht,chtf->ctf", weights / weights.sum(axis=0), shown)
    average: Complex = mean / (1 - mean * receptance[:, None])
    return average
