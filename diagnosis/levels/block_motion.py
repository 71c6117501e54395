"""Motion of a linear machine under hits and the force of its joint, in blocks of steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.levels.hammer_pulse import compute_pulse_force
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Complex, Integers, Real


@dataclass(eq=False)
class MachineInBlocks:
    """Motion of one linear machine under the hits of some cases, in blocks of steps.

    Modes are scaled to their share of the stretch, and kept without the joint's force of their own
    instant: with z the modes with it, z = free - b f. With j = D b + b_before a step is

        free_1 = D free_0 - j f_0 + hammer_1,

    so that k steps after the start of a block

        sum Re free_k = sum Re D^k free_0 - sum_(m < k) kernel_(k - 1 - m) f_m + hammer,
        kernel_i = sum Re D^i j.

    Args:
        columns: of the hits among those of all cases; (n_hit,).
        decay: D; (n_mode,).
        joint: j; (n_mode,).
        compliance: sum Re b.
        hammer: of the hits, by the force before and after a step; (n_mode, n_hit) each.
        pulse: force of the hits of peak 1, until the last one ends; (n_step, n_hit).
        state: free at the start of the next block; (n_mode, n_hit).
    """

    columns: Integers
    decay: Complex
    joint: Complex
    compliance: float
    hammer: tuple[Complex, Complex]
    pulse: Real
    state: Complex

    @classmethod
    def at_rest(
        cls,
        transient: JointTransient,
        hits: Sequence[SimulatedHits],
        columns: Integers,
        times: Real,
    ) -> "MachineInBlocks":
        """Return a machine at rest.

        Args:
            transient: linear machine in complex modes; those that hardly move the joint are left
                out.
            hits: of each case on it.
            columns: of all these hits among those of all machines; (n_hit,).
            times: of all steps [s]; (n_step,).
        """
        kept = transient.find_moving_modes()
        before, after = (weights[kept] for weights in transient.hold_weights)
        decay = np.exp(transient.poles[kept] / transient.rate_hz)
        readout = transient.readout[kept]
        at_joint = readout * transient.joint_entry[kept]
        column = np.concatenate([case.column for case in hits])
        peak = np.concatenate([case.peak for case in hits])
        entry = readout[:, None] * transient.input_entry[kept][:, column] * peak
        duration = np.concatenate([np.full(len(case.peak), case.duration_s) for case in hits])
        pulse = compute_pulse_force(times[times <= duration.max(), None], duration)
        return cls(
            columns,
            decay,
            (decay * after + before) * at_joint,
            float((after * at_joint).sum().real),
            (before[:, None] * entry, after[:, None] * entry),
            np.vstack([pulse, np.zeros(len(peak))]),
            np.zeros_like(entry),
        )

    @property
    def last(self) -> int:
        """Number of the first step after all hits."""
        return len(self.pulse) - 1

    @cached_property
    def _powers(self) -> Complex:
        """D^k of the steps of a block, from k = 0 on; (n_step + 1, n_mode)."""
        powers: Complex = self.decay ** np.arange(LEVEL_SETTINGS.block_steps + 1)[:, None]
        return powers

    @cached_property
    def _readout(self) -> Real:
        """Stretch in the steps of a block by real and imaginary parts; (n_step, 2 n_mode)."""
        return np.hstack([self._powers[1:].real, -self._powers[1:].imag])

    @cached_property
    def _states_by_forces(self) -> Complex:
        """State at the end of a block by its forces; (n_mode, n_step)."""
        states: Complex = (self._powers[-2::-1] * self.joint).T
        return states

    @cached_property
    def kernel(self) -> Real:
        """Stretch by a force one step before and more; (n_step,)."""
        kernel: Real = (self._powers[:-1] @ self.joint).real
        return kernel

    def look_ahead(self, first: int) -> Real:
        """Return the stretch in a block without its forces; (n_step, n_hit).

        Args:
            first: number of the step before the block.
        """
        free = self._readout @ np.vstack([self.state.real, self.state.imag])
        driven = np.zeros_like(self.state)
        if first < self.last:
            for k in range(LEVEL_SETTINGS.block_steps):
                driven *= self.decay[:, None]
                if first + k < self.last:
                    before, after = self.pulse[first + k : first + k + 2]
                    driven += self.hammer[0] * before + self.hammer[1] * after
                free[k] += driven.real.sum(axis=0)
        self.state *= self._powers[-1][:, None]
        self.state += driven
        return free

    def advance(self, forces: Real) -> None:
        """Change the state by the forces of the joint in a block; (n_step, n_hit)."""
        states = self._states_by_forces[:, -len(forces) :]
        self.state -= (states.real @ forces) + 1j * (states.imag @ forces)
