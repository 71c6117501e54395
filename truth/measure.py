r"""A hammer test of a known machine: hits, sensor noise, and the H1 estimate with its coherence.

Each hit has its own pulse and its own noise. With F the measured force and X the reading, summed
over the hits of one direction,

    H1 = sum X F* / sum |F|^2,   g2 = |sum X F*|^2 / (sum |X|^2 sum |F|^2).

H1 has the variance |H|^2 (1 - g2) / (g2 (n - 1)), real plus imaginary part.
"""

from dataclasses import dataclass

import numpy as np

from truth.draw import stream
from truth.errors import TruthError
from truth.station import Complex, Real

LINES = 801
RESOLUTION_HZ = 0.25

# A half sine this long has fallen by 14 dB at 200 Hz, by 9 and 21 dB at the ends of the scatter.
PULSE_SECONDS = 5.7e-3
PULSE_SCATTER = 0.15

# One-sided noise density of a reading [m/s2/sqrt(Hz)]: sensor and cable, and the building, which
# shakes below some 10 Hz. Each reading has its own: nothing of it passes through the machine.
FLOOR_DENSITY = 2e-5
AMBIENT_DENSITY = 6e-4
AMBIENT_CORNER_HZ = 6.0
AMBIENT_POWER = 3.0

# Relative noise of the measured force. It biases H1 by its square, which is far below its spread.
FORCE_NOISE = 1e-3


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a hammer test yields.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        frf: H1, accelerance [m/s2/N]; (n_freq, n_out, n_in).
        coherence: ordinary coherence; (n_freq, n_out, n_in).
        responses: node and direction 1, 2, 3 of each row.
        references: node and direction 1, 2, 3 of each column.
    """

    freq_hz: Real
    frf: Complex
    coherence: Real
    responses: tuple[tuple[int, int], ...]
    references: tuple[tuple[int, int], ...]

    def __post_init__(self) -> None:
        """Check that every array has its axes."""
        shape = (self.freq_hz.size, len(self.responses), len(self.references))
        if self.frf.shape != shape or self.coherence.shape != shape:
            raise TruthError(f"measurement: expected the shape {shape}, got {self.frf.shape}")


def lines_hz() -> Real:
    """Return the frequencies of the test, 0 to 200 Hz; (801,)."""
    return RESOLUTION_HZ * np.arange(LINES, dtype=np.float64)


def hammer_test(
    accelerance: Complex, freq_hz: Real, *, averages: int, level: float, seed: int
) -> tuple[Complex, Real]:
    """Hit the machine in each direction, one after the other, and estimate its accelerance.

    Args:
        accelerance: the true one [m/s2/N]; (n_freq, n_out, n_in).
        freq_hz: evenly spaced lines [Hz]; (n_freq,).
        averages: hits per direction, at least 2.
        level: mean peak force [N].
        seed: of the hits and of the noise.

    Returns:
        H1 and coherence, both (n_freq, n_out, n_in); H1 is zero at 0 Hz.

    Raises:
        TruthError: too few hits for a coherence, or a level that is not positive.
    """
    if averages < 2:
        raise TruthError(f"averages {averages}: a coherence needs at least 2 hits per direction")
    if not 0 < level < np.inf:
        raise TruthError(f"level {level}: give the hammer's peak force in N, more than 0")
    frf = np.empty_like(accelerance)
    coherence = np.empty(accelerance.shape)
    for column in range(accelerance.shape[2]):
        force = pulse_spectra(freq_hz, averages, level, stream(seed, f"hits.{column}"))
        reading = accelerance[:, :, column] * force[:, :, None]
        random = stream(seed, f"noise.response.{column}")
        reading += noise_spectrum(freq_hz)[:, None] * _complex_normal(random, reading.shape)
        random = stream(seed, f"noise.force.{column}")
        force = force * (1 + FORCE_NOISE * _complex_normal(random, force.shape))
        frf[:, :, column], coherence[:, :, column] = estimate_h1(force, reading)
    frf[freq_hz == 0] = 0
    return frf, coherence


def estimate_h1(force: Complex, reading: Complex) -> tuple[Complex, Real]:
    """Return H1 and coherence (n_freq, n_out) of spectra (hit, n_freq) and (hit, n_freq, n_out)."""
    cross = np.einsum("hfo,hf->fo", reading, force.conj())
    force_power = np.sum(np.abs(force) ** 2, axis=0)[:, None]
    reading_power = np.sum(np.abs(reading) ** 2, axis=0)
    return cross / force_power, np.abs(cross) ** 2 / (force_power * reading_power)


def pulse_spectra(
    freq_hz: Real, averages: int, level: float, random: np.random.Generator
) -> Complex:
    """Return the spectra of half-sine pulses [N s]; (averages, n_freq).

    A half sine of peak A and duration T has A T / 2 (sinc(f T - 1/2) + sinc(f T + 1/2)), turned
    by exp(-i pi f T) as it starts at time zero, with sinc(x) = sin(pi x) / (pi x).
    """
    scatter = random.uniform(1 - PULSE_SCATTER, 1 + PULSE_SCATTER, (2, averages, 1))
    peak, duration = level * scatter[0], PULSE_SECONDS * scatter[1]
    cycles = freq_hz * duration
    magnitude = peak * duration / 2 * (np.sinc(cycles - 0.5) + np.sinc(cycles + 0.5))
    spectra: Complex = magnitude * np.exp(-1j * np.pi * cycles)
    return spectra


def noise_spectrum(freq_hz: Real) -> Real:
    """Return the standard deviation of a reading's spectrum [m/s2 s]; (n_freq,).

    The building's density is flat up to its corner f0 and falls as f^-p above it,
    a / (1 + (f/f0)^2)^(p/2). A one-sided density d over a record of T seconds, one over the
    lines' spacing, gives d sqrt(T / 2).
    """
    spacing = freq_hz[1] - freq_hz[0]
    fall = (1 + (freq_hz / AMBIENT_CORNER_HZ) ** 2) ** (-AMBIENT_POWER / 2)
    density = np.hypot(FLOOR_DENSITY, AMBIENT_DENSITY * fall)
    spectrum: Real = density / np.sqrt(2 * spacing)
    return spectrum


def _complex_normal(random: np.random.Generator, shape: tuple[int, ...]) -> Complex:
    """Return complex normal numbers of mean square 1."""
    parts = random.standard_normal((2, *shape)) / np.sqrt(2)
    number: Complex = parts[0] + 1j * parts[1]
    return number
