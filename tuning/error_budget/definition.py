"""What an error budget is made of: errors, sources with their spectra, and control loops."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identification.words import Input, Output, Real
from tuning.error_budget.controller import Controller
from tuning.error_budget.spectra import Spectrum


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
        unit: SI unit in which it enters the machine or the measurement.
        derivative: number of time derivatives of a motion that this unit is.
    """

    name: str
    inputs: tuple[tuple[Input, complex], ...] = ()
    noise_of: str = ""
    spectrum: Spectrum | None = None
    lines: HarmonicLines | None = None
    unit: str = "N"
    derivative: int = 0


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


@dataclass(frozen=True, eq=False)
class BudgetDefinition:
    """Errors of interest, sources and loops.

    Args:
        errors: signals whose rms value is sought.
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
