"""Motion of linear machines under hits and the force of their joint, in blocks of steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from diagnosis.levels.hammer_pulse import compute_pulse_force
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Complex, Real


@dataclass(eq=False)
class MachinesInBlocks:
    """Motion of linear machines under hits, in blocks of steps.

    Modes are scaled to their share of the stretch, and kept without the joint's force of their own
    instant: with z the modes with it, z = free - b f. With j = D b + b_before a step is

        free_1 = D free_0 - j f_0 + hammer_1,

    so that k steps after the start of a block

        sum Re free_k = sum Re D^k free_0 - sum_(m < k) kernel_(k - 1 - m) f_m + hammer,
        kernel_i = sum Re D^i j.

    Args:
        decay: D; (n_case, n_mode).
        joint: j; (n_case, n_mode).
        compliance: sum Re b; (n_case,).
        hammer: effect of the hits' force before and after a step; (n_case, n_mode, n_hit) each.
        pulse: force of the hits of peak 1, until the last one ends; (n_step, n_case, 1, n_hit).
        state: free at the start of the next block; (n_case, n_mode, n_hit).
    """

    decay: Complex
    joint: Complex
    compliance: Real
    hammer: tuple[Complex, Complex]
    pulse: Real
    state: Complex

    @classmethod
    def at_rest(cls, cases: Sequence[tuple[JointTransient, SimulatedHits]], times: Real) -> Self:
        """Return machines at rest.

        Args:
            cases: linear machines in equal numbers of complex modes, and equal numbers of hits on
                each; modes that hardly move the joint of any machine are left out.
            times: of all steps [s]; (n_step,).
        """
        machines = {id(transient): transient for transient, _ in cases}
        count = max(len(transient.find_moving_modes()) for transient in machines.values())
        rows = {}
        for key, transient in machines.items():
            kept = transient.find_moving_modes(count)
            before, after = (weights[kept] for weights in transient.hold_weights)
            readout = transient.readout[kept]
            rows[key] = (
                np.exp(transient.poles[kept] / transient.rate_hz),
                before,
                after,
                readout * transient.joint_entry[kept],
                readout[:, None] * transient.input_entry[kept],
            )
        arrays = zip(*(rows[id(transient)] for transient, _ in cases), strict=True)
        decay, before, after, at_joint, entries = map(np.array, arrays)
        columns, peaks = (
            np.array([getattr(hits, name) for _, hits in cases]) for name in ("column", "peak")
        )
        entry = np.take_along_axis(entries, columns[:, None], axis=2) * peaks[:, None]
        durations = np.array([hits.duration_s for _, hits in cases])[:, None, None]
        during = times[times <= durations.max(), None, None, None]
        pulse = compute_pulse_force(during, durations)
        return cls(
            decay,
            (decay * after + before) * at_joint,
            (after * at_joint).sum(axis=1).real,
            (before[..., None] * entry, after[..., None] * entry),
            np.concatenate([pulse, np.zeros_like(pulse[:1])]),
            np.zeros_like(entry),
        )

    @property
    def last(self) -> int:
        """Number of the first step after all hits."""
        return len(self.pulse) - 1

    @cached_property
    def _powers(self) -> Complex:
        """D^k of the steps of a block, from k = 0 on; (n_case, n_step + 1, n_mode)."""
        steps = np.arange(LEVEL_SETTINGS.block_steps + 1)[:, None]
        return self.decay[:, None] ** steps

    @cached_property
    def _readout(self) -> Real:
        """Stretch in a block by real and imaginary parts; (n_case, n_step, 2 n_mode)."""
        powers = self._powers[:, 1:]
        return np.concatenate([powers.real, -powers.imag], axis=2)

    @cached_property
    def _states_by_forces(self) -> Complex:
        """State at the end of a block by its forces; (n_case, n_mode, n_step)."""
        return (self._powers[:, -2::-1] * self.joint[:, None]).transpose(0, 2, 1)

    @cached_property
    def kernel(self) -> Real:
        """Stretch by a force one step before and more; (n_step, n_case)."""
        return np.einsum("ckm,cm->kc", self._powers[:, :-1], self.joint).real

    def look_ahead(self, first: int) -> Real:
        """Return the stretch in a block without its forces; (n_step, n_case, n_hit).

        Args:
            first: number of the step before the block.
        """
        state = np.concatenate([self.state.real, self.state.imag], axis=1)
        free = np.ascontiguousarray((self._readout @ state).transpose(1, 0, 2))
        self.state *= self._powers[:, -1, :, None]
        if first < self.last:
            driven = np.zeros_like(self.state)
            for k in range(LEVEL_SETTINGS.block_steps):
                driven *= self.decay[..., None]
                if first + k < self.last:
                    before, after = self.pulse[first + k : first + k + 2]
                    driven += self.hammer[0] * before + self.hammer[1] * after
                free[k] += driven.real.sum(axis=1)
            self.state += driven
        return free

    def advance(self, forces: Real) -> None:
        """Change the state by the forces of the joint in a block; (n_step, n_case, n_hit)."""
        states = self._states_by_forces[..., -len(forces) :]
        of_cases = forces.transpose(1, 0, 2)
        self.state -= (states.real @ of_cases) + 1j * (states.imag @ of_cases)
