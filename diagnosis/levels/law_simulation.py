"""Time integration of laws under hits, many at once, and the stiffness that the laws show."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft

from diagnosis.levels.block_motion import MachinesInBlocks
from diagnosis.levels.hammer_pulse import compute_pulse_spectrum
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.restoring_laws import RestoringLaw, stack_laws
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.settings import NEGLIGIBLE_SHARE
from identification.words import Complex, Real, group_by_key


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
    alike = group_by_key(
        ((len(case.transient.poles), case.transient.duration_s), number)
        for number, case in enumerate(cases)
    )
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

    Modes that hardly move the joint are left out. Within a block of steps the law alone is solved
    step by step: the stretch that the state at the start of the block leaves in all its steps is
    one product of matrices, and so is the state at its end (``block_motion``).
    """
    rate, block = cases[0].transient.rate_hz, LEVEL_SETTINGS.block_steps
    count, hits = round(cases[0].transient.duration_s * rate), len(cases[0].hits.peak)
    machines = MachinesInBlocks.at_rest(
        [(case.transient, case.hits) for case in cases], np.arange(count + 1) / rate
    )
    compliance = np.repeat(machines.compliance, hits)
    kernel = np.repeat(machines.kernel[::-1], hits, axis=1)
    forces = np.zeros((count + 1, len(compliance)))
    largest, state = np.zeros(len(compliance)), law.start(len(compliance))
    for first in range(0, count, block):
        free = machines.look_ahead(first).reshape(block, -1)
        steps = range(1, min(block, count - first) + 1)
        for k in steps:
            past = np.einsum("kh,kh->h", kernel[block - k :], forces[first : first + k])
            forces[first + k], state = law.solve(free[k - 1] - past, compliance, state)
        n = first + len(steps)
        machines.advance(forces[first:n].reshape(len(steps), len(cases), hits))
        if n % LEVEL_SETTINGS.look_steps == 0:
            window = forces[n - LEVEL_SETTINGS.look_steps : n + 1]
            recent = np.abs(np.diff(window, axis=0)).max(axis=0)
            largest = np.maximum(largest, recent)
            is_over = n > machines.last + LEVEL_SETTINGS.look_steps
            if is_over and (recent <= LEVEL_SETTINGS.quiet_share * largest).all():
                forces[n:] = forces[n]
                break
    return forces


def _transform_forces(forces: Real, freq_hz: Real, rate_hz: float) -> Complex:
    """Return the transform of broken lines, their last value held; (n_hit, n_freq).

    i w X is the transform of the steps, each spread over one sample.
    """
    count, hits = len(forces) - 1, forces.shape[1]
    laplace = 2j * np.pi * freq_hz
    places = freq_hz * count / rate_hz
    nearest = np.rint(places).astype(int)
    if np.allclose(places, nearest, atol=NEGLIGIBLE_SHARE):
        width = LEVEL_SETTINGS.transformed_hits
        sums = np.concatenate(
            [
                rfft(np.diff(forces[:, first : first + width], axis=0), axis=0)[nearest]
                for first in range(0, hits, width)
            ],
            axis=1,
        )
    else:  # lines that are no multiples of their smallest distance
        times, steps = np.arange(count) / rate_hz, np.diff(forces, axis=0)
        sums = np.array([np.exp(-s * times) @ steps for s in laplace])
    spread = -np.expm1(-laplace / rate_hz) * rate_hz / laplace**2
    return (sums * spread[:, None]).T


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
