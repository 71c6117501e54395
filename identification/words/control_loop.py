"""Control loops of a machine: controllers, what they read, and the input that they drive.

The feedback is negative: u = -K(s) exp(-s tau) y, s = i w, time convention exp(+i w t).

A sampled controller reads y(k T), and a zero-order hold keeps its output over the period T. Of the
held output to a sine, the part at the frequency of the sine itself is (Astrom and Wittenmark 1997,
ch. 7)

    K(z) h(s) y,    z = exp(s T),    h(s) = (1 - exp(-s T)) / (s T)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words._arrays import Complex, Real, frozen_array
from identification.words.errors import InputError
from identification.words.ports import Input, Output

# Of s T, where searches of poles pass far from the imaginary axis.
_MAX_SAMPLED_EXPONENT = 300.0
# Distance in turns of z from 1, at multiples of the sampling rate.
_MIN_TURN = 1e-8
_MIN_POLE_Z = 1e-9  # of a pole in z, whose logarithm is to be finite


def zero_order_hold(laplace: Complex, period_s: float) -> Complex:
    """Return h(s) = (1 - exp(-s T)) / (s T) at each s; (n_freq,).

    Args:
        laplace: s [rad/s]; (n_freq,).
        period_s: T [s].
    """
    exponent = _clip_exponent(between_multiples(laplace, period_s) * period_s)
    is_zero = exponent == 0
    hold = -np.expm1(-exponent) / np.where(is_zero, 1.0, exponent)
    return np.where(is_zero, 1.0, hold)


def between_multiples(laplace: Complex, period_s: float) -> Complex:
    """Return each s [rad/s], moved off multiples of the sampling rate; (n_freq,).

    There z is 1, where integrators have no value and the hold is zero. Their product has one, which
    moves by 1e-7.

    Args:
        laplace [rad/s] (n_freq,), period_s [s]: as for ``zero_order_hold``.
    """
    turns = laplace.imag * period_s / (2 * np.pi)
    is_multiple = (np.abs(turns - np.round(turns)) < _MIN_TURN) & (np.abs(turns) > 0.5)
    return np.where(is_multiple, laplace + 2j * np.pi * _MIN_TURN / period_s, laplace)


def _clip_exponent(exponent: Complex) -> Complex:
    """Return exponents whose real parts lie within what a number can hold."""
    return (
        np.clip(exponent.real, -_MAX_SAMPLED_EXPONENT, _MAX_SAMPLED_EXPONENT) + 1j * exponent.imag
    )


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller K(s) = C (s - A)^-1 B + D, or a sampled one with z in place of s.

    Args:
        dynamics: A [1/s], without a unit if it is sampled; (n, n).
        input_matrix: B; (n, 1).
        output_matrix: C; (1, n).
        feedthrough: D; (1, 1).
        period_s: sampling period T [s]; 0 for a continuous controller.
    """

    dynamics: Real
    input_matrix: Real
    output_matrix: Real
    feedthrough: Real
    period_s: float = 0.0

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

    @property
    def poles(self) -> Complex:
        """Poles in s [rad/s]; of a sampled controller log(z) / T; (n,)."""
        poles = np.asarray(np.linalg.eigvals(self.dynamics), complex)
        return poles_in_s(poles, self.period_s) if self.period_s else poles

    def response(self, laplace: Complex) -> Complex:
        """Return K(s), or K(z) h(s) of a sampled controller, at each s [rad/s]; (n_freq,)."""
        if not self.period_s:
            return self._at(laplace)
        return self.sampled_response(laplace) * zero_order_hold(laplace, self.period_s)

    def sampled_response(self, laplace: Complex) -> Complex:
        """Return K(z) of a sampled controller, without its hold, at each s [rad/s]; (n_freq,)."""
        exponent = _clip_exponent(between_multiples(laplace, self.period_s) * self.period_s)
        return self._at(np.exp(exponent))

    def _at(self, points: Complex) -> Complex:
        """Return C (p - A)^-1 B + D at points p of the plane; (n_freq,)."""
        size = len(self.dynamics)
        if not size:
            return np.full(len(points), self.feedthrough[0, 0], complex)
        resolvent = points[:, None, None] * np.eye(size) - self.dynamics
        entry = np.broadcast_to(self.input_matrix.astype(complex), (len(points), size, 1))
        states = np.linalg.solve(resolvent, entry)
        response = self.output_matrix @ states + self.feedthrough
        return np.asarray(response[:, 0, 0], np.complex128)


def poles_in_s(poles_z: Complex, period_s: float) -> Complex:
    """Return poles log(z) / T of a system in discrete time [rad/s]; (n,).

    Args:
        poles_z: in z; those near 0, which forget at once, count as ``_MIN_POLE_Z``; (n,).
        period_s: T [s].
    """
    size = np.maximum(np.abs(poles_z), _MIN_POLE_Z)
    return np.asarray((np.log(size) + 1j * np.angle(poles_z)) / period_s, complex)


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
        resolution: step in which the encoder reads the signal; 0 for a continuous reading. This and
            the next two act in time alone: linear predictions leave them out.
        quantisation: step of the controller's output; 0 for none.
        limit: largest magnitude of the input; None without a limit.
    """

    name: str
    input: Input
    measured: PortSum
    controller: Controller
    input_unit: str
    delay: float = 0.0
    resolution: float = 0.0
    quantisation: float = 0.0
    limit: float | None = None

    @property
    def is_linear(self) -> bool:
        """Whether neither encoder, nor output steps, nor a limit make it nonlinear."""
        return not (self.resolution or self.quantisation) and self.limit is None


def sampling_period(loops: Sequence[Loop]) -> float:
    """Return the sampling period of loops [s]; 0 if they are continuous.

    Raises:
        InputError: loops of different periods, or sampled and continuous ones.
    """
    periods = {loop.controller.period_s for loop in loops}
    if len(periods) > 1:
        each = ", ".join(f"{loop.name} {_period_text(loop)}" for loop in loops)
        raise InputError(
            f"loops that act together must have one sampling period, but they are {each}: state "
            "all controllers with one period, or all as continuous ones with their delays"
        )
    return periods.pop() if periods else 0.0


def _period_text(loop: Loop) -> str:
    """Return the period of a loop in words."""
    period = loop.controller.period_s
    return f"sampled every {period:g} s" if period else "continuous"
