"""What an error budget is made of: errors, sources with their spectra, and control loops."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identification.words import Input, Loop, PortSum, Real
from tuning.plant.error_budget.spectra import Spectrum


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
