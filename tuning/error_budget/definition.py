"""What an error budget is made of: errors, sources with their spectra, and control loops."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identification.words import DERIVATIVE_ORDER, Dof, Input, Quantity, Real
from tuning.error_budget.controller import Controller
from tuning.error_budget.spectra import Spectrum


@dataclass(frozen=True, eq=False)
class PortSum:
    """A weighted sum of outputs, such as the difference of two points along an axis.

    Args:
        name: of the signal.
        terms: outputs with their weights; all translations, or all rotations.
    """

    name: str
    terms: tuple[tuple[Dof, float], ...]

    @property
    def is_rotation(self) -> bool:
        """Whether it is an angle."""
        return self.terms[0][0].is_rotation

    def __str__(self) -> str:
        """Return the outputs with their signs, such as ``hexapod:+tx - ty:+tx``."""
        texts = [f"{'-' if weight < 0 else '+'} {dof}" for dof, weight in self.terms]
        return " ".join(texts).removeprefix("+ ")


@dataclass(frozen=True, eq=False)
class HarmonicLines:
    """Sines of a source.

    Args:
        freq_hz: frequency of each [Hz]; (n_line,).
        amplitude: peak of each in SI; (n_line,).
    """

    freq_hz: Real
    amplitude: Real


@dataclass(frozen=True, eq=False)
class Source:
    """A disturbance at inputs of the machine, or the noise of a loop's measurement.

    Args:
        name: of the source.
        inputs: inputs at which one signal acts, with a complex factor each; empty for noise.
        noise_of: loop whose measurement it disturbs; empty for a disturbance.
        spectrum: density of the signal; None for lines alone.
        lines: sines of the signal; None for a random signal alone.
    """

    name: str
    inputs: tuple[tuple[Input, complex], ...] = ()
    noise_of: str = ""
    spectrum: Spectrum | None = None
    lines: HarmonicLines | None = None


@dataclass(frozen=True, eq=False)
class Loop:
    """A control loop with negative feedback: u = -K (y + n), n the noise of the measurement.

    Args:
        name: of the loop.
        input: input of the machine that the controller drives.
        measured: signal that the controller reads.
        quantity: of that signal: receptance for a position, mobility, accelerance.
        controller: K, in units of the input per SI unit of the signal.
        delay: of the controller [s].
    """

    name: str
    input: Input
    measured: PortSum
    controller: Controller
    quantity: Quantity = "receptance"
    delay: float = 0.0

    @property
    def derivative(self) -> int:
        """Number of time derivatives of the measured signal."""
        return DERIVATIVE_ORDER[self.quantity]


@dataclass(frozen=True, eq=False)
class BudgetDefinition:
    """Errors of interest, sources and loops.

    Args:
        errors: signals whose rms value is sought [m or rad].
        units: unit in which each error is shown and its SI value, by the error's name.
        sources: disturbances and noise.
        loops: control loops that are closed.
        coherence: complex coherence function of the sources, Hermitian with a unit diagonal;
            (n_source, n_source).
        band: lowest and highest frequency [Hz].
        remarks: sentences on what the definition leaves out.
    """

    errors: tuple[PortSum, ...]
    sources: tuple[Source, ...]
    loops: tuple[Loop, ...]
    coherence: np.ndarray[tuple[int, int], np.dtype]
    band: tuple[float, float]
    units: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def derivatives(self) -> tuple[int, ...]:
        """Number of time derivatives in which each source enters the machine or the loop."""
        by_loop = {loop.name: loop.derivative for loop in self.loops}
        return tuple(
            by_loop[source.noise_of]
            if source.noise_of
            else 2 * int(any(is_motion(port) for port, _ in source.inputs))
            for source in self.sources
        )

    @property
    def is_closed(self) -> bool:
        """Whether there is a loop."""
        return bool(self.loops)


def is_motion(port: Input) -> bool:
    """Return whether an input is a motion of the floor, which enters as an acceleration."""
    return isinstance(port, Dof) and port.point == "floor"
