r"""A hammer test of a known machine: hits, sensor noise, and the H1 estimate with its coherence.

Each hit has its own pulse and its own noise. With F the measured force and X the reading, summed
over the hits of one direction,

    H1 = sum X F* / sum |F|^2,   g2 = |sum X F*|^2 / (sum |X|^2 sum |F|^2).

H1 has the variance |H|^2 (1 - g2) / (g2 (n - 1)), real plus imaginary part.
"""

from dataclasses import dataclass, replace

import numpy as np

from truth.campaign.machine_on_test import Known, TrueMachine
from truth.campaign.measured import MeasuredTest, UserCampaign
from truth.campaign.protocol import Channel, Protocol, Take, take_occasions
from truth.errors import NoPlaceError, TruthError
from truth.machine.nonlinear import RATE_HZ, HalfSinePulses, nonlinear_readings
from truth.machine.rig import Occasion
from truth.machine.station import Complex, Real
from truth.random_streams import stream

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
        frf: H1, accelerance [m/s2/N], encoders in what they read; (n_freq, n_out, n_in).
        coherence: ordinary coherence, (n_freq, n_out, n_in); None if it was not kept.
        responses: node and direction 1, 2, 3 of each row.
        references: node and direction 1, 2, 3 of each column.
    """

    freq_hz: Real
    frf: Complex
    coherence: Real | None
    responses: tuple[Channel, ...]
    references: tuple[Channel, ...]

    def __post_init__(self) -> None:
        """Check that every array has its axes."""
        shape = (self.freq_hz.size, len(self.responses), len(self.references))
        kept = self.frf if self.coherence is None else self.coherence
        if self.frf.shape != shape or kept.shape != shape:
            raise TruthError(f"measurement: expected the shape {shape}, got {self.frf.shape}")


def hammer_test(machine: TrueMachine, protocol: Protocol, take: Take, seed: int) -> Measurement:
    """Hit the machine in each direction, one after the other, and estimate its accelerance.

    Args:
        machine: with its effects; sensors in the station's order.
        protocol: lines, averages.
        take: level, set-up and channels.
        seed: of the hits and of the noise.

    Returns:
        What the file holds; H1 is zero at 0 Hz.
    """
    return _hammer_test(Known(machine, protocol.freq_hz), protocol, take, seed, name="")


def hammer_tests(
    machine: TrueMachine, protocol: Protocol, files: tuple[Take, ...], seed: int
) -> tuple[Measurement, ...]:
    """Make the test of every file; the arguments as of one."""
    known = Known(machine, protocol.freq_hz)
    if protocol.measured is not None:
        return tuple(
            _stated_test(known, take, take.test, stream(seed, f"noise.measured.{number}"))
            for number, take in enumerate(files)
            if take.test is not None
        )
    return tuple(
        _hammer_test(known, protocol, take, seed, name=f".{number}" if number else "")
        for number, take in enumerate(files)
    )


def _hammer_test(
    known: Known, protocol: Protocol, take: Take, seed: int, *, name: str
) -> Measurement:
    freq_hz, station = protocol.freq_hz, known.machine.station
    points = [(sensor.node, axis) for _, sensor in station.sensors() for axis in (1, 2, 3)]
    rows = [points.index(channel) for channel in take.channels]
    references = tuple((node, axis) for node in protocol.nodes for axis in (1, 2, 3))
    shape = (freq_hz.size, len(rows), len(references))
    frf, coherence = np.empty(shape, np.complex128), np.empty(shape)
    hits = [
        draw_pulses(
            protocol.averages, take.level, stream(seed, f"hits{name}.{column}"), protocol.pace
        )
        for column in range(len(references))
    ]
    occasions = [
        Occasion(take.level, node, axis - 1, take.setup, visit=take.visit)
        for node, axis in references
    ]
    added = nonlinear_part(known, occasions, hits, RATE_HZ * protocol.pace)
    for column, pulses in enumerate(hits):
        force = pulse_spectra(freq_hz, pulses)
        reading = linear_frfs(known, occasions[column], len(force)) * force[:, :, None]
        if added is not None:
            reading += added[column]
        reading = reading[:, :, rows]
        if protocol.dead in take.channels:
            reading[:, :, take.channels.index(protocol.dead)] = 0.0
        random = stream(seed, f"noise.response{name}.{column}")
        reading += noise_spectrum(freq_hz, protocol.resolution_hz)[:, None] * _complex_normal(
            random, reading.shape
        )
        random = stream(seed, f"noise.force{name}.{column}")
        force = force * (1 + FORCE_NOISE * _complex_normal(random, force.shape))
        hammer = known.machine.hammers[known.machine.column(occasions[column])]
        force = force / (hammer.gain * np.exp(-2j * np.pi * freq_hz * hammer.delay))
        frf[:, :, column], coherence[:, :, column] = estimate_h1(force, reading)
    frf[freq_hz == 0] = 0
    kept = coherence if protocol.coherence else None
    return Measurement(freq_hz, frf, kept, take.channels, references)


def _stated_test(
    known: Known, take: Take, test: MeasuredTest, random: np.random.Generator
) -> Measurement:
    """Repeat one reference of a user's test: unit forces, and the noise that was measured.

    Every hit has the noise of the mean times the square root of their number.
    """
    (occasion,) = take_occasions(Protocol(), take)
    if known.on(occasion)[0].joints:
        raise NoPlaceError("FRFs of a user's test do not tell how hard each hit was")
    sensors = {sensor.node: sensor for _, sensor in known.machine.station.sensors()}
    rows = [3 * [*sensors].index(node) + axis - 1 for node, axis in test.channels]
    hits = max(test.stated.averages, 1)
    signs = test.sign * np.array(test.signs)
    motion = signs * linear_frfs(known, occasion, hits)[:, :, rows]
    hammer = known.machine.hammers[known.machine.column(occasion)]
    noise = np.sqrt(hits) * test.stated.deviation
    shape = (hits, *noise.shape)
    reading = np.broadcast_to(motion, shape) + noise * _complex_normal(random, shape)
    channel = hammer.gain * np.exp(-2j * np.pi * known.freq_hz * hammer.delay)
    force = np.broadcast_to(1 / channel, (hits, len(channel)))
    frf, coherence = estimate_h1(force, reading)
    integrals = [sensors[node].integrals for node, _ in test.channels]
    frf = frf / (2j * np.pi * known.freq_hz[:, None]) ** integrals
    kept = coherence[:, :, None] if test.stated.averages > 1 else None
    node, axis = test.reference
    return Measurement(
        known.freq_hz, frf[:, :, None], kept, test.channels, ((node, test.sign * (axis + 1)),)
    )


def linear_frfs(known: Known, occasion: Occasion, count: int) -> Complex:
    """Linear FRFs of a column at each of its hits; (n_hit, n_freq, n_out), n_hit 1 if all alike."""
    column = known.machine.column(occasion)
    hits = [replace(occasion, time=float(time)) for time in np.linspace(0, 1, count)]
    if len({known.machine.when(hit) for hit in hits}) == 1:
        hits = hits[:1]
    return np.stack([known.on(hit)[1][:, :, column] for hit in hits])


def nonlinear_part(
    known: Known, occasions: list[Occasion], hits: list[HalfSinePulses], rate_hz: float = RATE_HZ
) -> list[Complex] | None:
    """What nonlinear joints add to the spectra of each column's hits; None if there are none.

    All columns that share a rig go through time together.

    Args:
        known: machine, at all lines of the test.
        occasions: of the columns.
        hits: their pulses.
        rate_hz: samples per second of the integration.

    Returns:
        For each column (n_hit, n_freq, n_out) [m/s2 s].
    """
    groups: dict[int, list[int]] = {}
    for number, occasion in enumerate(occasions):
        groups.setdefault(id(known.on(occasion)[0]), []).append(number)
    by_occasion: dict[int, Complex] = {}
    for numbers in groups.values():
        rig = known.on(occasions[numbers[0]])[0]
        if not rig.joints:
            return None
        columns = tuple(
            known.machine.column(occasions[number]) for number in numbers for _ in hits[number].peak
        )
        pulses = HalfSinePulses(
            np.concatenate([hits[number].peak for number in numbers]),
            np.concatenate([hits[number].duration for number in numbers]),
        )
        readings = nonlinear_readings(rig, columns, pulses, known.freq_hz, rate_hz)
        ends = np.cumsum([len(hits[number].peak) for number in numbers])[:-1]
        by_occasion.update(zip(numbers, np.split(readings, ends), strict=True))
    return [by_occasion[number] for number in range(len(occasions))]


def estimate_h1(force: Complex, reading: Complex) -> tuple[Complex, Real]:
    """Return H1 and coherence (n_freq, n_out) of spectra (hit, n_freq) and (hit, n_freq, n_out)."""
    cross = np.einsum("hfo,hf->fo", reading, force.conj())
    force_power = np.sum(np.abs(force) ** 2, axis=0)[:, None]
    reading_power = np.sum(np.abs(reading) ** 2, axis=0)
    return cross / force_power, np.abs(cross) ** 2 / (force_power * reading_power)


def draw_pulses(
    averages: int, level: float, random: np.random.Generator, pace: float = 1.0
) -> HalfSinePulses:
    """Draw the pulses of one direction: half sines about the level and the usual duration.

    Args:
        averages: number of hits.
        level: mean peak force [N].
        random: random numbers of the hits.
        pace: factor by which the hits are shorter than usual.
    """
    scatter = random.uniform(1 - PULSE_SCATTER, 1 + PULSE_SCATTER, (2, averages, 1))
    return HalfSinePulses(level * scatter[0, :, 0], PULSE_SECONDS / pace * scatter[1, :, 0])


def pulse_spectra(freq_hz: Real, pulses: HalfSinePulses) -> Complex:
    """Return the spectra of half-sine pulses [N s]; (n_hit, n_freq).

    A half sine of peak A and duration T has A T / 2 (sinc(f T - 1/2) + sinc(f T + 1/2)), turned
    by exp(-i pi f T) as it starts at time zero, with sinc(x) = sin(pi x) / (pi x).
    """
    peak, duration = pulses.peak[:, None], pulses.duration[:, None]
    cycles = freq_hz * duration
    magnitude = peak * duration / 2 * (np.sinc(cycles - 0.5) + np.sinc(cycles + 0.5))
    return magnitude * np.exp(-1j * np.pi * cycles)


def noise_spectrum(freq_hz: Real, spacing: float) -> Real:
    """Return the standard deviation of a reading's spectrum [m/s2 s]; (n_freq,).

    The building's density is flat up to its corner f0 and falls as f^-p above it,
    a / (1 + (f/f0)^2)^(p/2). A one-sided density d over a record of T seconds, one over the
    lines' spacing, gives d sqrt(T / 2).
    """
    fall = (1 + (freq_hz / AMBIENT_CORNER_HZ) ** 2) ** (-AMBIENT_POWER / 2)
    density = np.hypot(FLOOR_DENSITY, AMBIENT_DENSITY * fall)
    return density / np.sqrt(2 * spacing)


def _complex_normal(random: np.random.Generator, shape: tuple[int, ...]) -> Complex:
    """Return complex normal numbers of mean square 1."""
    parts = random.standard_normal((2, *shape)) / np.sqrt(2)
    return parts[0] + 1j * parts[1]


def frf_deviation(
    base: Complex, lines: Real, protocol: Protocol, level: float, machine: TrueMachine
) -> Real:
    """Return the standard deviation of H1, real plus imaginary part, that a hammer test will have.

    Args:
        base: FRFs of the machine; (n_line, n_out, n_in).
        lines: frequencies [Hz]; (n_line,).
        protocol: averages and spacing of the lines of the test.
        level: mean peak force [N].
        machine: whose sensors and hits are the rows and columns.
    """
    if protocol.measured is not None:
        return _measured_deviation(base, lines, protocol.measured, machine)
    pulse = HalfSinePulses(np.array([level]), np.array([PULSE_SECONDS / protocol.pace]))
    force = np.abs(pulse_spectra(lines, pulse)[0]) * np.sqrt(protocol.averages)
    spacing = protocol.freq_hz[1] - protocol.freq_hz[0]
    sensor = noise_spectrum(lines, spacing) / force
    hammer = FORCE_NOISE * np.abs(base) / np.sqrt(protocol.averages)
    return np.sqrt(sensor[:, None, None] ** 2 + hammer**2)


def _measured_deviation(
    base: Complex, lines: Real, measured: UserCampaign, machine: TrueMachine
) -> Real:
    """Return the standard deviation of what a user's test measures; infinite elsewhere.

    A cell that several files hold counts as their weighted mean.
    """
    information = np.zeros(base.shape)
    places = np.searchsorted(measured.freq_hz, lines)
    points = [sensor.node for _, sensor in machine.station.sensors()]
    for test in measured.tests:
        rows = [3 * points.index(node) + axis - 1 for node, axis in test.channels]
        node, axis = test.reference
        column = machine.column(Occasion(node=node, axis=axis))
        information[:, rows, column] += test.stated.deviation[places] ** -2.0
    with np.errstate(divide="ignore"):
        deviation: Real = information**-0.5
    return deviation
