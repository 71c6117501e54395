"""Time integration of laws under hits, many at once, and the stiffness that the laws show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.fft import rfft

from diagnosis.levels.hammer_pulse import compute_pulse_force, compute_pulse_spectrum
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.restoring_laws import RestoringLaw, stack_laws
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.rounding import NEGLIGIBLE_SHARE
from identification.words import Complex, Integers, Real


@dataclass(frozen=True, eq=False)
class LawUnderHits:
    """A law beside a linear machine, and the hits on it.

    Args:
        transient: linear machine.
        law: of the joint, beside it.
        hits: the hits.
    """

    transient: JointTransient
    law: RestoringLaw
    hits: SimulatedHits


def compute_equivalent_stiffness(cases: Sequence[LawUnderHits], freq_hz: Real) -> Complex:
    """Return kappa of laws of one kind under each hit [N/m or N m/rad]; (n_case, n_hit, n_freq).

    Cases with equal numbers of modes and equal records go through time together. A softening spring
    that gives way has no stiffness: its values are not finite.

    Args:
        cases: with equal numbers of hits, and equal steps.
        freq_hz: lines, none at 0 Hz; (n_freq,).
    """
    alike: dict[tuple[int, float], list[int]] = {}
    for number, case in enumerate(cases):
        shape = len(case.transient.poles), case.transient.duration_s
        alike.setdefault(shape, []).append(number)
    kappa = np.zeros((len(cases), len(cases[0].hits.peak), len(freq_hz)), complex)
    with np.errstate(over="ignore", invalid="ignore"):
        for numbers in alike.values():
            kappa[numbers] = _compute_stiffness([cases[k] for k in numbers], freq_hz)
    return kappa


def _compute_stiffness(cases: Sequence[LawUnderHits], freq_hz: Real) -> Complex:
    first = cases[0].transient
    law = stack_laws([case.law for case in cases], len(cases[0].hits.peak))
    forces = _transform_forces(_integrate_forces(cases, law), freq_hz, first.rate_hz)
    kappa = []
    machines = {id(case.transient): case.transient for case in cases}
    receptances = {key: machine.receptances(freq_hz).T for key, machine in machines.items()}
    for case, force in zip(cases, np.split(forces, len(cases)), strict=True):
        receptance, hits = receptances[id(case.transient)], case.hits
        hammer = hits.peak[:, None] * compute_pulse_spectrum(freq_hz, hits.duration_s)
        stretch = receptance[1 + hits.column] * hammer - receptance[0] * force
        kappa.append(force / np.where(stretch != 0, stretch, np.inf))
    return np.array(kappa)


def compute_peak_stretch(transient: JointTransient, hits: SimulatedHits) -> Real:
    """Return the largest stretch of a linear machine under each hit; (n_hit,)."""
    recorder = _PeakRecorder(np.zeros(len(hits.peak)))
    _integrate_forces([LawUnderHits(transient, recorder, hits)], recorder)
    return recorder.peak


def _integrate_forces(cases: Sequence[LawUnderHits], law: RestoringLaw) -> Real:
    """Return the joint's force at every sample; (n_sample + 1, n_case n_hit).

    Modes that hardly move the joint are left out. The others are scaled to their share of the
    stretch, and kept without the joint's force of their own instant, so that a step takes two
    products: with z the modes with it, z = free - b f gives

        free_1 = D free_0 - (D b + b_before) f_0 + hammer.
    """
    rate = cases[0].transient.rate_hz
    count = round(cases[0].transient.duration_s * rate)
    modes = [case.transient.find_moving_modes() for case in cases]
    most = max(map(len, modes))
    modes = [case.transient.find_moving_modes(most) for case in cases]
    steps = [_StepWeights.of(case, kept) for case, kept in zip(cases, modes, strict=True)]
    decay, joint_before, joint_after, hammer_before, hammer_after = (
        np.concatenate(weights, axis=1) for weights in zip(*steps, strict=True)
    )
    hits = decay.shape[1]
    compliance = joint_after.sum(axis=0).real
    joint = decay * joint_after + joint_before
    times = np.arange(count + 1) / rate
    pulse = np.concatenate(
        [
            np.tile(compute_pulse_force(times, case.hits.duration_s)[:, None], len(case.hits.peak))
            for case in cases
        ],
        axis=1,
    )
    last = int(np.flatnonzero(pulse.any(axis=1)).max()) + 1
    free, state = np.zeros(decay.shape, complex), law.start(hits)
    change = np.zeros_like(free)
    forces, largest = np.zeros((count + 1, hits)), 0.0
    for n in range(1, count + 1):
        free *= decay
        free -= np.multiply(joint, forces[n - 1], out=change)
        if n <= last:
            free += hammer_before * pulse[n - 1] + hammer_after * pulse[n]
        forces[n], state = law.solve(np.add.reduce(free.real, axis=0), compliance, state)
        if n % LEVEL_SETTINGS.look_steps == 0:
            recent = float(
                np.abs(np.diff(forces[n - LEVEL_SETTINGS.look_steps : n + 1], axis=0)).max()
            )
            largest = max(largest, recent)
            if (
                n > last + LEVEL_SETTINGS.look_steps
                and recent <= LEVEL_SETTINGS.quiet_share * largest
            ):
                forces[n:] = forces[n]
                break
    return forces


class _StepWeights(NamedTuple):
    """Propagation of a case over one step, of the modes' shares of the stretch; (n_mode, n_hit)."""

    decay: Complex
    joint_before: Complex
    joint_after: Complex
    hammer_before: Complex
    hammer_after: Complex

    @classmethod
    def of(cls, case: LawUnderHits, kept: Integers) -> "_StepWeights":
        """Return the weights of a case for the modes that are kept."""
        transient, hits = case.transient, case.hits
        step = 1 / transient.rate_hz
        before, after = (weights[kept] for weights in transient.hold_weights)
        readout = transient.readout[kept]
        entry = readout[:, None] * transient.input_entry[kept][:, hits.column] * hits.peak
        joint = readout * transient.joint_entry[kept]

        def repeat(column: Complex) -> Complex:
            return np.tile(column[:, None], len(hits.peak))

        return cls(
            repeat(np.exp(transient.poles[kept] * step)),
            repeat(before * joint),
            repeat(after * joint),
            before[:, None] * entry,
            after[:, None] * entry,
        )


def _transform_forces(forces: Real, freq_hz: Real, rate_hz: float) -> Complex:
    """Return the transform of broken lines, their last value held; (n_hit, n_freq).

    i w X is the transform of the steps, each spread over one sample.
    """
    steps = np.diff(forces, axis=0)
    laplace = 2j * np.pi * freq_hz
    places = freq_hz * len(steps) / rate_hz
    nearest = np.rint(places).astype(int)
    if np.allclose(places, nearest, atol=NEGLIGIBLE_SHARE):
        sums = rfft(np.ascontiguousarray(steps.T))[:, nearest].T
    else:  # lines that are no multiples of their smallest distance
        times = np.arange(len(steps)) / rate_hz
        sums = np.array([np.exp(-s * times) @ steps for s in laplace])
    spread = -np.expm1(-laplace / rate_hz) * rate_hz / laplace**2
    transform: Complex = (sums * spread[:, None]).T
    return transform


@dataclass(frozen=True, eq=False)
class _PeakRecorder:
    """No force; records the largest stretch of each hit."""

    peak: Real

    def start(self, count: int) -> Real:
        return np.zeros(count)

    def solve(self, free: Real, compliance: Real, state: Real) -> tuple[Real, Real]:
        del compliance
        np.maximum(self.peak, np.abs(free), out=self.peak)
        return np.zeros_like(free), state
