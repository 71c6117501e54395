"""The uncertain plant: a linear fractional transformation of the parameters' changes.

    G(delta) = F_u(M, Delta) = M22 + M21 Delta (1 - M11 Delta)^-1 M12,   Delta = diag(delta_i 1_ri)

(Zhou, Doyle and Glover 1996, ch. 10). Each parameter changes the equation of motion by the low-rank
matrix delta_i U_i V_i' (``matrix_slopes``). With v_i = V_i' (q, q', q'', u) and w_i = delta_i v_i,
the forces -U_i w_i act on the nominal machine, which is M: inputs (w, u), outputs (v, y).

    delta_i = exp(scale x_i) - 1, relative, for sizes;   delta_i = scale x_i in SI for the rest

M holds stiffness, damping, mass and inertia exactly at any delta. Positions of joints and centres
of mass enter by their slopes, and so does a product of mass and centre of mass. The error of that
is measured at samples of the posterior (``measure_lft_error``).

The posterior is an ellipsoid, x = R z with |z|^2 <= chi2. To first order delta = S R z, with S the
diagonal matrix of the scales.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Integers, Mask, Real
from mbmodel import Evaluator, FrfRequest, SystemMatrices
from tuning.assessment.parameter_posterior import PosteriorOfModel

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class UncertainPlant:
    """M of the linear fractional transformation, with its blocks.

    Args:
        names: coordinate of each block; n_block.
        ranks: size r_i of each block; (n_block,).
        is_exact: whether each block holds its parameter exactly at any size; (n_block,).
        is_relative: whether delta_i is relative, or in SI; (n_block,).
        root: x of each block per z; (n_block, n_z).
        scale: of each block's x; (n_block,).
        a, b, c, d: of M, inputs (w, u), outputs (v, y).
        inputs, outputs: labels of u and y.
        quantity: of the outputs.
    """

    names: tuple[str, ...]
    ranks: Integers
    is_exact: Mask
    is_relative: Mask
    root: Real
    scale: Real
    a: Real
    b: Real
    c: Real
    d: Real
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    quantity: str

    def __repr__(self) -> str:
        """Return the size of M and of its blocks in one line."""
        return (
            f"uncertain plant: {len(self.outputs)} outputs, {len(self.inputs)} inputs, "
            f"{len(self.a)} states, {len(self.names)} blocks of {self.width} in all"
        )

    @property
    def width(self) -> int:
        """Number of entries of w and v."""
        return int(self.ranks.sum())

    @property
    def deviation(self) -> Real:
        """Standard deviation of each delta, to first order; (n_block,)."""
        return self.scale * np.linalg.norm(self.root, axis=1)

    def delta(self, z: Real) -> Real:
        """Return the delta of whitened coordinates; (n_block,).

        Args:
            z: (n_z,).
        """
        step = self.scale * (self.root @ z)
        return np.where(self.is_relative, np.expm1(np.where(self.is_relative, step, 0)), step)

    def close(self, delta: Real) -> SystemMatrices:
        """Return F_u(M, Delta).

        Args:
            delta: of each block; (n_block,).
        """
        width = self.width
        change = np.repeat(delta, self.ranks)
        inner = np.eye(width) - change[:, None] * self.d[:width, :width]
        feedback = np.linalg.solve(inner, change[:, None] * np.hstack([self.c, self.d])[:width])
        to_states, to_inputs = feedback[:, : len(self.a)], feedback[:, len(self.a) + width :]
        drive, through = self.b[:, :width], self.d[width:, :width]
        return SystemMatrices(
            self.a + drive @ to_states,
            self.b[:, width:] + drive @ to_inputs,
            self.c[width:] + through @ to_states,
            self.d[width:, width:] + through @ to_inputs,
        )

    def sample(self, z: Real) -> control.StateSpace:
        """Return the plant at whitened coordinates as a state space of python-control.

        Args:
            z: standard normal for a sample of the posterior; (n_z,).
        """
        import control  # noqa: PLC0415  # with its matplotlib it would slow down every start

        plant = self.close(self.delta(z))
        labels = {"inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(plant.a, plant.b, plant.c, plant.d, **labels)

    def nominal(self) -> control.StateSpace:
        """Return the fitted plant as a state space of python-control."""
        return self.sample(np.zeros(self.root.shape[1]))


def measure_lft_error(
    plant: UncertainPlant, posterior: PosteriorOfModel, request: FrfRequest, z: Real
) -> float:
    """Return the largest error of the plant at samples, relative to the peak of each FRF.

    Args:
        plant: the uncertain plant.
        posterior: of the model that it was made of.
        request: its outputs, inputs and lines.
        z: whitened coordinates of the samples; (n_sample, n_z).
    """
    evaluator, largest = Evaluator(posterior.model, request), 0.0
    for sample in z:
        theta = posterior.theta(posterior.posterior.root @ sample)
        exact = evaluator.at(theta).values
        peak = np.abs(exact).max(axis=0)
        error = np.abs(plant.close(plant.delta(sample)).at(request.laplace) - exact)
        largest = max(largest, float((error / np.where(peak == 0, 1.0, peak)).max(initial=0.0)))
    return largest
