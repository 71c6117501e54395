"""Control loops of a machine: controllers, what they read, and the input that they drive.

The feedback is negative: u = -K(s) exp(-s tau) y, s = i w, time convention exp(+i w t).
"""

from dataclasses import dataclass

import numpy as np

from identification.words._arrays import Complex, Real, frozen_array
from identification.words.signal import Input, Output


@dataclass(frozen=True, eq=False)
class Controller:
    """A continuous controller K(s) = C (s - A)^-1 B + D.

    Args:
        dynamics: A [1/s]; (n, n).
        input_matrix: B; (n, 1).
        output_matrix: C; (1, n).
        feedthrough: D; (1, 1).
    """

    dynamics: Real
    input_matrix: Real
    output_matrix: Real
    feedthrough: Real

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        n = len(np.atleast_1d(self.dynamics)) if np.size(self.dynamics) else 0
        shapes = {
            "dynamics": (n, n),
            "input_matrix": (n, 1),
            "output_matrix": (1, n),
            "feedthrough": (1, 1),
        }
        for name, shape in shapes.items():
            object.__setattr__(
                self, name, frozen_array(getattr(self, name), np.float64, shape, name)
            )

    def response(self, laplace: Complex) -> Complex:
        """Return K(s) at each s [rad/s]; (n_freq,)."""
        size = len(self.dynamics)
        if not size:
            return np.full(len(laplace), self.feedthrough[0, 0], complex)
        resolvent = laplace[:, None, None] * np.eye(size) - self.dynamics
        entry = np.broadcast_to(self.input_matrix.astype(complex), (len(laplace), size, 1))
        states = np.linalg.solve(resolvent, entry)
        response = self.output_matrix @ states + self.feedthrough
        return np.asarray(response[:, 0, 0], np.complex128)


@dataclass(frozen=True, eq=False)
class PortSum:
    """A weighted sum of outputs, such as the difference of two points along an axis.

    Args:
        name: of the signal.
        terms: outputs with their weights; all of one unit.
        unit: SI unit in which they are read.
        derivative: number of time derivatives of motions to be taken; 0 for sensors, which read
            their own.
    """

    name: str
    terms: tuple[tuple[Output, float], ...]
    unit: str
    derivative: int = 0

    def __str__(self) -> str:
        """Return the outputs with their signs, such as ``hexapod:+tx - ty:+tx``."""
        texts = [f"{'-' if weight < 0 else '+'} {port}" for port, weight in self.terms]
        return " ".join(texts).removeprefix("+ ")


@dataclass(frozen=True, eq=False)
class Loop:
    """A control loop with negative feedback: u = -K (y + n), n the noise of the measurement.

    Args:
        name: of the loop.
        input: input of the machine that the controller drives.
        measured: signal that the controller reads.
        controller: K, in units of the input per SI unit of the signal.
        input_unit: SI unit of the input, or that it is a control.
        delay: of the controller [s].
    """

    name: str
    input: Input
    measured: PortSum
    controller: Controller
    input_unit: str
    delay: float = 0.0
