r"""Hits on a machine with one nonlinear joint direction, and the stiffness that it shows.

The motion is that of the linear machine under the hit f and under the joint's force -g(q), q the
stretch of the joint direction d,

    q(t) = h_f * f - h_g * g(q).

In complex modes z' = lambda z + b_f f - b_g g is exact for forces that are straight between samples
a step h apart (first-order hold; Franklin, Powell and Workman 1998, ch. 4):

    z_1 = e^(lambda h) z_0 + b (gamma_0 f_0 + gamma_1 f_1),
    gamma_1 = (e^x - 1 - x) / (lambda x),  gamma_0 = (e^x - 1) / lambda - gamma_1,  x = lambda h.

The law then solves one scalar equation a step (``restoring_laws``). With the transforms G of g and
Q = H_f F - H_g G of the stretch, the joint acts on each line as a complex stiffness

    kappa(w) = G(w) / Q(w),

and a linear machine with that spring has exactly the FRFs of the nonlinear one under this hit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.fft import next_fast_len

from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Complex, Integers, Real
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.export.branch_states import branch_states
from mbmodel.export.state_space import FirstOrderForm, first_order_form


@dataclass(frozen=True, eq=False)
class SimulatedHits:
    """Hits that are simulated at once.

    Args:
        column: input of each; (n_hit,).
        peak: force [N]; (n_hit,).
        duration_s: of all.
    """

    column: Integers
    peak: Real
    duration_s: float


@dataclass(frozen=True, eq=False)
class JointTransient:
    """A linear machine in complex modes, seen from one joint direction.

    Args:
        poles: lambda, one of each conjugate pair [rad/s]; (n_mode,).
        readout: q = Re(readout z); (n_mode,).
        joint_entry: b_g; (n_mode,).
        input_entry: b_f; (n_mode, n_in).
        rate_hz: samples per second.
        duration_s: longest record [s].
    """

    poles: Complex
    readout: Complex
    joint_entry: Complex
    input_entry: Complex
    rate_hz: float
    duration_s: float

    @classmethod
    def of_matrices(
        cls,
        matrices: Matrices,
        direction: Real,
        inputs: Real,
        freq_hz: Real,
        loops: Sequence[FrequencyDependentTerm] = (),
        steps_per_period: int = LEVEL_SETTINGS.steps_per_period,
    ) -> "JointTransient":
        """Return the machine of M, C and K with its control loops.

        Args:
            matrices: M, C, K of the linear machine.
            direction: of the joint, in joint coordinates; (nv,).
            inputs: generalised force of each input; (nv, n_in).
            freq_hz: lines of the FRFs, which set step and length; (n_freq,).
            loops: control loops that are closed, with Pade's fractions of their delays.
            steps_per_period: least number of steps in a period of the highest line.
        """
        # A machine on no springs drifts: far below the lowest line that does not matter.
        slowest = 2 * np.pi * LEVEL_SETTINGS.drift_share * freq_hz[freq_hz > 0].min()
        forces = np.column_stack([direction, inputs])
        poles, shapes, entry = _solve_state(_first_order(matrices, loops, forces, freq_hz))
        if np.abs(poles).min() < slowest:
            grounded = replace(matrices, stiffness=matrices.stiffness + slowest**2 * matrices.mass)
            poles, shapes, entry = _solve_state(_first_order(grounded, loops, forces, freq_hz))
        size = len(matrices.mass)
        kept = poles.imag >= 0
        pairs = np.where(poles.imag > 0, 2.0, 1.0)
        spacing = float(np.diff(freq_hz).min()) if len(freq_hz) > 1 else float(freq_hz[0])
        samples = next_fast_len(int(np.ceil(steps_per_period * freq_hz[-1] / spacing)), real=True)
        slowest_decay = max(
            float(-poles.real.max()),
            LEVEL_SETTINGS.end_decay * spacing / LEVEL_SETTINGS.max_records,
        )
        records = np.ceil(LEVEL_SETTINGS.end_decay * spacing / slowest_decay)
        return cls(
            poles[kept],
            (direction @ shapes[:size] * pairs)[kept],
            entry[kept, 0],
            entry[kept, 1:],
            spacing * samples,
            records / spacing,
        )

    def receptances(self, freq_hz: Real) -> Complex:
        """Return the stretch per force of the joint, then of each input; (n_freq, 1 + n_in)."""
        laplace = 2j * np.pi * freq_hz[:, None]
        residues = self.readout[:, None] * np.column_stack([self.joint_entry, self.input_entry])
        upper, lower = 1 / (laplace - self.poles), 1 / (laplace - self.poles.conj())
        return (upper @ residues + lower @ residues.conj()) / 2

    def find_moving_modes(self, least: int = 0) -> Integers:
        """Return the modes that move the joint, those that move it most first.

        A mode moves it by its residue over its decay rate: the height of its resonance.

        Args:
            least: number of modes that are returned at least.
        """
        residues = np.column_stack([self.joint_entry, self.input_entry]) * self.readout[:, None]
        peaks = (
            np.abs(residues)
            / np.maximum(-self.poles.real, LEVEL_SETTINGS.end_decay / self.duration_s)[:, None]
        )
        share = (peaks / np.maximum(peaks.max(axis=0), np.finfo(float).tiny)).max(axis=1)
        count = max(int((share > LEVEL_SETTINGS.negligible_mode_share).sum()), least)
        return np.argsort(-share, kind="stable")[:count]

    @cached_property
    def hold_weights(self) -> tuple[Complex, Complex]:
        """gamma_0 and gamma_1 of each mode [s]; (n_mode,) each."""
        before, after = _compute_hold_weights(self.poles / self.rate_hz)
        return before / self.rate_hz, after / self.rate_hz


def _compute_hold_weights(turns: Complex) -> tuple[Complex, Complex]:
    """Return gamma_0 / h and gamma_1 / h of x = lambda h; (n_mode,) each."""
    is_small = np.abs(turns) < LEVEL_SETTINGS.series_bound
    x = np.where(is_small, 1.0, turns)
    growth = np.expm1(x) / x
    series = turns * (1 / 6 + turns * (1 / 24 + turns / 120))
    after = np.where(is_small, 0.5 + series, (growth - 1) / x)
    whole = np.where(is_small, 1 + turns * (0.5 + series), growth)
    return whole - after, after


def _first_order(
    matrices: Matrices, loops: Sequence[FrequencyDependentTerm], forces: Real, freq_hz: Real
) -> FirstOrderForm:
    """Return the machine with its loops in first order, driven by forces (nv, n_force)."""
    return first_order_form(branch_states(matrices, loops, freq_hz), forces)


def _solve_state(form: FirstOrderForm) -> tuple[Complex, Complex, Complex]:
    """Return poles (n,), shapes (n, n) and modal entries of the forces (n, n_force)."""
    poles, shapes = scipy.linalg.eig(form.dynamics)
    return poles, shapes, np.linalg.solve(shapes, form.gain.astype(complex))
