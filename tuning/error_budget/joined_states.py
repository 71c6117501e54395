r"""A machine and controllers joined in one state space, in continuous or in discrete time.

The machine x' = A x + B_w w + B_u u, y = C x + D_w w + D_u u and the controllers
x_k' = A_k x_k + B_k y, u = -(C_k x_k + D_k y) give

    E = (1 + D_k D_u)^-1
    A_cl = [A - B_u E D_k C,          -B_u E C_k            ]   B_cl = [B_w - B_u E D_k D_w      ]
           [B_k (C - D_u E D_k C),     A_k - B_k D_u E C_k  ]          [B_k (1 - D_u E D_k) D_w  ]

In discrete time x[k+1] stands in place of x'.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from identification.words import Complex, Real, poles_in_s
from mbmodel.export.system_matrices import SystemMatrices


@dataclass(frozen=True, eq=False)
class LoopStates:
    """State space of the machine with its loops, from w to the errors.

    Args:
        dynamics: A_cl; (n, n).
        gain: B_cl of accelerations and forces, velocities of the floor, its displacements, each
            n_in, and noise; (n, 3 n_in + n_loop).
        readout: C of the errors; (n_error, n).
        reading: C of what each controller reads, measurement and noise; (n_loop, n).
        noise_through: D of it by the noise; (n_loop, n_loop).
        period_s: sampling period of the loops [s], for states from the noise alone, in discrete
            time; 0 in continuous time.
    """

    dynamics: Real
    gain: Real
    readout: Real
    reading: Real
    noise_through: Real
    period_s: float = 0.0

    def poles(self) -> Complex:
        """Return the poles, of sampled loops log(z) / T [rad/s]; (n,)."""
        poles = np.asarray(np.linalg.eigvals(self.dynamics), complex)
        return poles_in_s(poles, self.period_s) if self.period_s else poles

    def modal_terms(self) -> tuple[Complex, Complex, Complex]:
        """Return poles (n,), c_r (n_error, n) and b_r (n, 3 n_in + n_loop), in continuous time."""
        poles, vectors = np.linalg.eig(self.dynamics)
        return poles, self.readout @ vectors, np.linalg.solve(vectors, self.gain.astype(complex))


def join_loops(
    plant: SystemMatrices,
    controllers: Sequence[tuple[Real, Real, Real, Real]],
    gain: Real,
    by_input: Real,
    period_s: float = 0.0,
) -> LoopStates:
    """Return plant and controllers as one state space, without the readout of errors.

    Args:
        plant: from the controls to the measurements of the loops.
        controllers: A_k, B_k, C_k, D_k of each loop.
        gain: B_w; (n, n_w).
        by_input: D_w; (n_loop, n_w).
        period_s: sampling period of discrete time [s]; 0 in continuous time.
    """
    states, drive, output, through = (
        block_diag(*matrices) for matrices in zip(*controllers, strict=True)
    )
    inverse = np.linalg.inv(np.eye(len(plant.d)) + through @ plant.d)
    seen = np.eye(len(plant.d)) - plant.d @ inverse @ through
    dynamics = np.block(
        [
            [plant.a - plant.b @ inverse @ through @ plant.c, -plant.b @ inverse @ output],
            [drive @ seen @ plant.c, states - drive @ plant.d @ inverse @ output],
        ]
    )
    total = np.vstack([gain - plant.b @ inverse @ through @ by_input, drive @ seen @ by_input])
    reading = np.hstack([seen @ plant.c, -plant.d @ inverse @ output])
    return LoopStates(dynamics, total, np.zeros((0, len(dynamics))), reading, seen, period_s)
