r"""Effect of a law on the joint in each test: linear about a start, averaged over scattered hits.

No two hits are alike: H1 is the average of what all hits of a test show, each weighted by the power
of its force. With kappa_i the joint's stiffness under hit i, beside that of one linear machine, and
h_g the joint's receptance there, a hit of force F_i shows (``joint_update``)

    H_i = H_0 - h_o h_i c_i,   c_i = kappa_i / (1 + kappa_i h_g),

so that the average over hits has the stiffness

    kappa = c / (1 - c h_g),   c = sum |F_i|^2 c_i / sum |F_i|^2,

exactly. Records tell the momenta of the hits; without them the logarithm of a hit's size is taken
as normal. A few equally probable sizes stand for all. The average is taken as linear in the
variance, which FRFs tell and the refit therefore fits.

The FRFs are linear in c, and so is this table: c is taken as linear in the parameters of the law
and in the joint's linear spring and damper, which are fitted with it. The kappa that a model needs
follows exactly. It is no linear function itself: it has a pole wherever the joint hardly stretches,
and a gap takes away whatever spring a fit tries, so that kappa follows the spring and c does not.

A single hit shows a rough function of the parameters of a law: where its decaying motion touches a
stop or slides for the last time changes by jumps. Several sizes smooth it, as many hits of a test
do, the more of them the better. Derivatives are central differences between equal hits over a
distance on which roughness does not count, with fewer hits and longer steps of time: they say where
a search goes, not where it ends.

The scale of a whole machine hardly shows: the gains of hammer and sensors hide it. A table that
held the mass against the joint's spring would see a shift of its resonance instead, which pinned
the sizes of a law, and too narrowly. The table therefore follows the mass of the body on the joint
as the scale of the machine. With M, C, K and all forces of the law s times as large, the motion
under hits that are s times as strong is the same, so that with K the joint's whole stiffness

    dK/d(ln s) = K - sum dK/d(ln p) - dK/d(ln peak)

over all parameters p that scale with forces: no simulation.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from identification.words import Complex, Mask, Real


@dataclass(frozen=True, eq=False)
class LawTable:
    """Effect of a law on the joint at each line of each test, linear about where a refit begins.

    The coordinates are logarithms of sizes, and parameters that are no sizes as they are. Hits of
    another peak are those of the estimated one on a similar law: all motion scales with them if the
    length or force of the law does (``LawFamily.similarity``).

    Args:
        joint: linear machine and hits.
        names: names of the values of the start; n_parameter.
        start: where a refit begins: parameters of the law, values of the joint's linear spring or
            damper and of the mass that it follows, relative duration; (n_parameter,).
        is_size: which of these are positive sizes; (n_parameter,).
        receptance: h_g of that machine; (n_freq,).
        mean: c of the mean hit of each test; (n_test, n_freq).
        slopes: derivatives of c by the coordinates of the start, by the variance of the hits and by
            the logarithm of their peak; (n_parameter + 2, n_test, n_freq).
    """

    joint: TestedJoint
    family: LawFamily
    names: tuple[str, ...]
    start: Real
    is_size: Mask
    receptance: Complex
    mean: Complex
    slopes: Complex

    @classmethod
    def simulate(
        cls,
        joint: TestedJoint,
        family: LawFamily,
        start: tuple[float, ...],
        followed: tuple[str, ...] = (),
    ) -> Self:
        """Simulate a law about a start.

        Args:
            followed: which of "stiffness", "damping" and "mass" stand beside the parameters of the
                law.
        """
        chosen = LEVEL_SETTINGS
        names = (*(name for name, _ in family.parameters), *followed, "duration")
        is_size = np.array([*family.is_size, *(True for _ in followed), True])
        is_moved = np.array([name != "mass" for name in names])
        steps = np.array(
            [
                chosen.linear_step if name == "stiffness" else chosen.difference_step
                for name in names
            ]
        )[is_moved]
        receptance = joint.transient().receptances(joint.freq_hz)[:, 0]

        def simulate(joint: TestedJoint, places: Real, sizes: Real) -> Complex:
            """Return c; places (n_place, n_parameter), sizes (n_hit, n_group)."""
            places = np.where(is_size, np.exp(places), places)
            springs = [_read_spring(joint, names, place) for place in places]
            cases = [
                (np.append(place[: len(family.parameters)], place[-1]), size, spring)
                for place, spring in zip(places, springs, strict=True)
                for size in sizes
            ]
            kappa = joint.compute_stiffness(family, cases)
            kappa = kappa.reshape(len(places), len(sizes), *kappa.shape[1:])
            added = np.array([_add_spring(joint, spring) for spring in springs])
            return show(kappa + added[:, None, None], receptance)

        groups, origin = joint.group_equal_hits(), _to_coordinates(np.array(start), is_size)
        coarse = replace(joint, steps_per_period=chosen.coarse_steps_per_period)
        few, many = (joint.list_hit_sizes(n) for n in (chosen.hit_sizes // 2, chosen.hit_sizes))
        moves = np.zeros((len(steps), len(names)))
        moves[:, is_moved] = np.diag(steps)
        with np.errstate(invalid="ignore"):  # a spring that gives way has no stiffness
            moved = simulate(coarse, np.concatenate([origin + moves, origin - moves]), few)
            ahead, behind = np.split(average_hits(moved, few[:, groups] ** 2), 2)
            by_place = np.zeros((len(names), *ahead.shape[1:]), complex)
            by_place[is_moved] = (ahead - behind) / (2 * steps[:, None, None])
            (shown,) = simulate(joint, origin[None], np.vstack([np.ones(many.shape[1]), many]))
            (average,) = average_hits(shown[None, 1:], many[:, groups] ** 2)
            mean = shown[0]
        number, power = family.similarity
        by_peak = power * by_place[number]
        if "mass" in names:
            share = 1 - average * receptance
            whole = average / share - _add_spring(joint, np.zeros(2))
            is_force = [*family.is_force, *(name != "mass" for name in followed), False]
            by_place[~is_moved] = share**2 * whole - by_place[is_force].sum(axis=0) - by_peak
        slopes = np.array([*by_place, average - mean, by_peak])
        return cls(joint, family, names, np.array(start), is_size, receptance, mean, slopes)

    def at(self, theta: Real, test: int) -> tuple[Complex, Complex]:
        """Return kappa in a test (n_freq,), and its derivatives by theta (n_parameter + 2, n_freq).

        Args:
            theta: parameters as in ``start``, relative variance of hits, and their relative peak.
            test: its number.
        """
        is_size = np.append(self.is_size, [False, True])
        origin = np.append(_to_coordinates(self.start, self.is_size), [0.0, 0.0])
        slopes = self.slopes[:, test]
        share = 1 - self.receptance * (
            shown := self.mean[test] + (_to_coordinates(theta, is_size) - origin) @ slopes
        )
        spring = _read_spring(self.joint, self.names, theta)
        by_theta = slopes / np.where(is_size, theta, 1.0)[:, None] / share**2
        for name, change in (("stiffness", 1.0), ("damping", 2j * np.pi * self.joint.freq_hz)):
            if name in self.names:
                by_theta[self.names.index(name)] -= change
        return shown / share - _add_spring(self.joint, spring), by_theta


def _to_coordinates(theta: Real, is_size: Mask) -> Real:
    """Return logarithms of sizes, other parameters as they are; (n_parameter,)."""
    return np.where(is_size, np.log(np.where(is_size, theta, 1.0)), theta)


def _read_spring(joint: TestedJoint, names: tuple[str, ...], theta: Real) -> Real:
    """Return stiffness and damping of the joint's linear spring and damper; (2,)."""
    values = {"stiffness": joint.stiffness, "damping": joint.damping}
    values |= zip(names, theta.tolist(), strict=False)
    return np.array([values["stiffness"], values["damping"]])


def _add_spring(joint: TestedJoint, spring: Real) -> Complex:
    """Return what a linear spring and damper add to those of the machine; (n_freq,)."""
    stiffness, damping = spring - (joint.stiffness, joint.damping)
    return stiffness + 2j * np.pi * joint.freq_hz * damping


def show(stiffness: Complex, receptance: Complex) -> Complex:
    """Return c = kappa / (1 + kappa h_g), in which the FRFs are linear; (..., n_freq)."""
    return stiffness / (1 + stiffness * receptance)


def average_hits(shown: Complex, weights: Real) -> Complex:
    """Return c of the average of several hits that H1 shows; (n_case, n_test, n_freq).

    Args:
        shown: c under each hit; (n_case, n_hit, n_test, n_freq).
        weights: of each hit, its number times the power of its force; (n_hit, n_test).
    """
    return np.einsum("ht,chtf->ctf", weights / weights.sum(axis=0), shown)
