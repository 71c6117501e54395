r"""How much of an effect survives a refit: one linearised refit at the truth.

A user who does not know the effect tunes stiffness and damping, and every tolerance within 2.5 of
its standard deviations. To first order about the true machine the FRFs then follow

    min_x  sum |(r - J x) / sd|^2 + sum_tolerances x^2,   |x_tolerance| <= 2.5,

r being what the effect changes, J the slopes by log k, log c and by each tolerance in units of its
standard deviation. What remains of r, against the noise as the excess of a campaign has it, is

    ratio^2 = mean over channels of  sum_f |r - J x|^2 / sum_f sd^2,

the survival ratio sqrt(e1^2 - e0^2) / e0 of the excess e1 with the effect and e0 without it, since
about the truth e0 = 1. Beside a background of small imperfections e0 is larger, the refit weighs
values by noise and background together, and the ratio is over e0. J is in ``frf_sensitivities``.

That is the first step of a refit. Where stiffness and damping can follow an effect far (losses, a
bypass, a delay), further steps hide much more of it: ``retuned_ratio`` takes them, each with J
about the stiffness and damping that the step before came to, with falling allowance, and only those
that the FRFs themselves approve (Levenberg-Marquardt). Steps that nobody checks end anywhere: a
damper far weaker hides a short delay to a hundredth of what they leave.
"""

import operator
from dataclasses import dataclass, field, replace

import numpy as np

from truth.campaign.draw import Tolerances
from truth.campaign.frf_sensitivities import jacobian, jacobian_again
from truth.campaign.linear_refit import LinearRefit, normal_matrix
from truth.campaign.machine_on_test import Known, TrueMachine
from truth.campaign.measure import (
    PULSE_SECONDS,
    frf_deviation,
    linear_frfs,
    nonlinear_part,
    pulse_spectra,
)
from truth.campaign.protocol import Protocol, Take, take_occasions
from truth.errors import NoPlaceError
from truth.machine.nonlinear import HalfSinePulses
from truth.machine.rig import Occasion
from truth.machine.station import Complex, Joint, Real

# Relative errors that further steps may leave, one after the other, and how many are tried: as the
# noise weighs lines, peaks that have moved lead astray.
_ALLOWANCES = ((0.3, 4), (0.1, 4), (0.03, 6), (0.01, 6), (0.0, 16))
_LOGARITHMIC = 0.1  # above it the logarithm of the ratio is fitted
_FARTHEST = 1.0  # logarithm of a stiffness or damping in one of them
_CAUTION = 1e-3  # of J^T J's diagonal, added to it
_BOLDER, _WARIER = 0.2, 10.0  # times that after a step that helps, or does not
_TOLERANT_STEPS = 4  # of a refit that tolerates an error of the model
_LITTLE = 0.01  # of the cost: who gains less has arrived
_REFIT_LINES = 120  # lines of the refit
_LOWEST_HZ = 5.0  # below, the building's noise drowns a hammer test
_COARSE_HZ = 4096.0  # samples per second of nonlinear joints, when only a size is looked for


@dataclass(frozen=True, eq=False)
class Remainder:
    """What a refit leaves of a machine without effects.

    Args:
        noise: sd of each value by noise alone; (n_line, n_out, n_in).
        reading: factor from acceleration to what the channel reads; (n_line, n_out, 1).
        excess: e0: 1 where nothing but noise is left, more beside a background.
    """

    noise: Real
    reading: Real
    excess: float


@dataclass(frozen=True, eq=False)
class SurvivalRefit(LinearRefit):
    """A linearised refit of one machine and test, ready for any effect.

    Args:
        machine: the true one, without effects.
        protocol: how it is tested.
        takes: its files of one level; every channel is in one of them.
        known: its accelerance at the refit's lines.
        tolerance: standard deviations of the priors.
        without: what is left without effects, over which the ratio is.
    """

    machine: TrueMachine
    protocol: Protocol
    takes: tuple[Take, ...]
    known: Known
    tolerance: Tolerances
    without: Remainder
    _last_change: list[tuple[TrueMachine, Complex]] = field(default_factory=list)

    @property
    def noise_share(self) -> Real:
        """Norm of the noise over that of the FRF, for each channel; (n_out, n_in)."""
        base = (np.abs(self._base()) ** 2).sum(axis=0)
        return np.sqrt((self.without.noise**2).sum(axis=0) / base)

    def ratio(self, machine: TrueMachine) -> float:
        """Return the survival ratio of the effects of a machine, to first order."""
        change = self.change(machine)
        return self._residual_ratio(change - self.fit_change(change))

    def retuned_ratio(self, machine: TrueMachine, least: float = 0.0) -> float:
        """Return the survival ratio after further steps of the refit.

        Args:
            machine: with its effects.
            least: no further steps are taken where less is left.
        """
        goal = self._base() + self.change(machine)
        moved, left = np.zeros(self.n_springs), self.ratio(machine)
        for allowance, tries in _ALLOWANCES:
            moved, now = self._descend(goal, moved, allowance, tries)
            left = min(left, self._residual_ratio(now))
            if left < least:
                break
        return left

    def motion_left(self, machine: TrueMachine, allowance: float) -> Real:
        """Return the relative motion of each channel that a refit leaves of a machine's effects.

        The refit tolerates a relative error, as one that knows its model to be inexact does.

        Args:
            machine: with its effects.
            allowance: relative error that the refit tolerates.

        Returns:
            Norm over the lines of what is left, over that of the FRF; (n_out, n_in).
        """
        goal = self._base() + self.change(machine)
        moved, left = np.zeros(self.n_springs), goal - self._base()
        for step, tries in ((_LOGARITHMIC, _TOLERANT_STEPS), (allowance, _TOLERANT_STEPS)):
            moved, left = self._descend(goal, moved, step, tries)
        power = (np.abs(left) ** 2).sum(axis=0) / (np.abs(goal) ** 2).sum(axis=0)
        return np.sqrt(power) * self.used[:, None]

    def _descend(
        self, goal: Complex, moved: Real, allowance: float, tries: int
    ) -> tuple[Real, Complex]:
        """Take steps of stiffness and damping towards FRFs.

        Args:
            goal: the FRFs; like deviation.
            moved: logarithms of the factors of stiffness and damping at the start.
            allowance: of the FRFs' sizes, added to the deviation.
            tries: steps at most.

        Returns:
            The logarithms, and what they and tolerances leave; like deviation.
        """
        deviation = np.sqrt(self.deviation**2 + (allowance * np.abs(goal)) ** 2)
        about, caution = self.relinearise(moved, deviation), _CAUTION
        off = _off(goal, about._base(), allowance)
        left, cost = about.fit_tolerances(off)
        for _ in range(tries):
            step = about.solve(off, caution)[0][: self.n_springs]
            ahead = moved + np.clip(step, -_FARTHEST, _FARTHEST)
            known = Known(self._vary_springs(ahead), self.known.freq_hz)
            there = _off(goal, self._accelerance(known), allowance)
            less, better = about.fit_tolerances(there)
            if better >= cost:
                caution *= _WARIER
                continue
            gain, moved, left, caution = 1 - better / cost, ahead, less, caution * _BOLDER
            if gain < _LITTLE:
                break
            about, off = about._with_joints(known), there
            left, cost = about.fit_tolerances(off)
        return moved, left

    def relinearise(self, logarithms: Real, deviation: Real) -> "SurvivalRefit":
        """Return the refit about a machine with other stiffness and damping.

        Args:
            logarithms: of the factors, of stiffness and damping of each joint and then each tendon.
            deviation: of each value, with what the refit may leave anyway.
        """
        machine = self._vary_springs(logarithms)
        known = Known(machine, self.known.freq_hz) if logarithms.any() else self.known
        weight = self.used[:, None] / deviation
        if known is self.known:
            slopes = self.slopes.weighted_anew(self.used[:, None] / self.deviation, weight)
        else:
            slopes = jacobian(machine, known.freq_hz, self.tolerance, weight)
        normal = normal_matrix(slopes, deviation.shape) + np.diag(self.bounded.astype(float))
        return replace(
            self,
            machine=machine,
            known=known,
            deviation=deviation,
            slopes=slopes,
            normal=normal,
            _last_change=[],
        )

    def _with_joints(self, known: Known) -> "SurvivalRefit":
        """About other stiffness and damping, whose slopes alone are made anew."""
        weight = self.used[:, None] / self.deviation
        slopes = jacobian_again(known.machine, known.freq_hz, weight, self.slopes)
        normal = normal_matrix(slopes, self.deviation.shape, self.normal)
        return replace(
            self,
            machine=known.machine,
            known=known,
            slopes=slopes,
            normal=normal,
            _last_change=[],
        )

    def _vary_springs(self, logarithms: Real) -> TrueMachine:
        factors = iter(np.exp(logarithms).tolist())

        def vary(joint: Joint) -> Joint:
            stiffness, damping = joint.stiffness * next(factors), joint.damping * next(factors)
            return replace(joint, stiffness=stiffness, damping=damping)

        station = self.machine.station.vary_joints(vary)
        tendons = tuple(
            replace(
                tendon,
                stiffness=tendon.stiffness * next(factors),
                damping=tendon.damping * next(factors),
            )
            for tendon in station.tendons
        )
        return replace(self.machine, station=replace(station, tendons=tendons))

    def _base(self) -> Complex:
        """Accelerances without effects; like deviation."""
        return self._accelerance(self.known)

    def _accelerance(self, known: Known) -> Complex:
        return known.on(Occasion(node=self.protocol.nodes[0]))[1]

    def _residual_ratio(self, left: Complex) -> float:
        reading, noise = self.without.reading, self.without.noise
        power = (np.abs(reading * left) ** 2).sum(axis=0) / ((reading * noise) ** 2).sum(axis=0)
        counted = self.used[:, None] & np.isfinite(noise).all(axis=0)
        return float(np.sqrt(power[counted].mean())) / self.without.excess

    def change(self, machine: TrueMachine) -> Complex:
        """What the effects change in the FRFs, as the hammer test would find; like deviation.

        The last change is kept: a size that was found is the start of further steps.
        """
        for kept, change in self._last_change:
            if _are_same(kept, machine):
                return change
        change = self._computed_change(machine)
        self._last_change[:] = [(machine, change)]
        return change

    def _computed_change(self, machine: TrueMachine) -> Complex:
        known, whole = Known(machine, self.known.freq_hz), Known(machine, self.protocol.freq_hz)
        base = self._base()
        values = np.array(base)
        points = [sensor.node for _, sensor in machine.station.sensors()]
        duration = PULSE_SECONDS / self.protocol.pace
        pulse = HalfSinePulses(np.array([self.takes[0].level]), np.array([duration]))
        force = pulse_spectra(self.known.freq_hz, pulse)[0]
        places = np.searchsorted(self.protocol.freq_hz, self.known.freq_hz)
        for take in self.takes:
            rows = [3 * points.index(node) + axis - 1 for node, axis in take.channels]
            occasions = take_occasions(self.protocol, take)
            added = None
            if known.on(occasions[0])[0].joints:
                if take.test is not None:
                    raise NoPlaceError("FRFs of a user's test do not tell how hard each hit was")
                rate = _COARSE_HZ * self.protocol.pace
                added = nonlinear_part(whole, list(occasions), [pulse] * len(occasions), rate)
            for number, occasion in enumerate(occasions):
                column = machine.column(occasion)
                mean = linear_frfs(known, occasion, self.protocol.averages).mean(axis=0)
                if added is not None:
                    mean = mean + added[number][0][places] / force[:, None]
                values[:, rows, column] = mean[:, rows]
        return values - base


def refit_of(
    machine: TrueMachine,
    protocol: Protocol,
    takes: tuple[Take, ...],
    tolerance: Tolerances,
    background: Real | None = None,
    count: int = _REFIT_LINES,
) -> SurvivalRefit:
    """Linearise a machine without effects at a part of its lines.

    Args:
        machine: the true one, its effects are left out.
        takes: the files of one level.
        background: relative motion of each channel that small imperfections leave, which counts
            beside the noise; (n_out, n_in).
        count: number of lines, about.
    """
    plain = replace(machine, effects=())
    lines = _choose_lines(protocol, count)
    known = Known(plain, lines)
    base = known.on(Occasion(node=protocol.nodes[0]))[1]
    noise = frf_deviation(base, lines, protocol, takes[0].level, plain)
    deviation, excess = noise, 1.0
    points = [(sensor.node, axis) for _, sensor in plain.station.sensors() for axis in (1, 2, 3)]
    used = np.array([point != protocol.dead for point in points])
    integrals = np.repeat([sensor.integrals for _, sensor in plain.station.sensors()], 3)
    reading = ((2 * np.pi * lines[:, None]) ** -integrals.astype(float))[:, :, None]
    if background is not None:
        deviation = np.hypot(noise, background * np.abs(base))
        read, heard = (np.sum(np.abs(reading * each) ** 2, axis=0) for each in (base, noise))
        power = background**2 * read / heard
        counted = used[:, None] & np.isfinite(noise).all(axis=0)
        excess = float(np.sqrt(1 + power[counted].mean()))
    slopes = jacobian(plain, lines, tolerance, used[:, None] / deviation)
    refit = SurvivalRefit(
        deviation=deviation,
        used=used,
        slopes=slopes,
        normal=normal_matrix(slopes, deviation.shape),
        machine=plain,
        protocol=protocol,
        takes=takes,
        known=known,
        tolerance=tolerance,
        without=Remainder(noise, reading, excess),
    )
    return replace(refit, normal=refit.normal + np.diag(refit.bounded.astype(float)))


def _are_same(before: TrueMachine, after: TrueMachine) -> bool:
    """Whether both have the very same parts."""
    old, new = ((machine.station, machine.hammers, *machine.effects) for machine in (before, after))
    return len(old) == len(new) and all(map(operator.is_, old, new))


def _off(goal: Complex, now: Complex, allowance: float) -> Complex:
    """How far FRFs are from others; where much is allowed by the logarithm of their ratio.

    Of small errors that is the same, of large ones it leads back.
    """
    return now * np.log(goal / now) if allowance >= _LOGARITHMIC else goal - now


def _choose_lines(protocol: Protocol, count: int) -> Real:
    """Lines of the refit, evenly from where a hammer test begins to tell."""
    lines = protocol.freq_hz[protocol.freq_hz >= _LOWEST_HZ * protocol.pace]
    return lines[:: max(1, len(lines) // count)]
