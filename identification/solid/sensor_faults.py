"""Hypotheses on what may be wrong with a sensor, as changes of the model of a body's readings."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from identification.solid.body_channels import BodyData, exchange_channels
from identification.solid.rigid_fit import RigidFitModel
from identification.solid.sensor_errors import Sensors
from identification.words import Complex, Real, Tolerance

# Logarithm of the prior probability of each effect, per place. Flexibility is common; the others
# are mistakes of mounting and cabling, a few in a campaign of twenty sensors.
_LOG_PRIOR = {
    name: float(np.log(probability))
    for name, probability in {
        "sensor_gain": 1e-3,
        "sensor_polarity": 2e-3,
        "sensor_misalignment": 3e-3,
        "sensor_position": 3e-3,
        "sensor_swap": 1e-3,
        "sensor_delay": 1e-3,
        "mount_resonance": 1e-3,
        "flexible_body": 3e-2,
        "sensor_unknown": 1e-4,
    }.items()
}
# Half-width of the Cauchy prior of a released error: half of all wrong gains are within 20 %
# [1], rotations within some 10 degrees [rad], places within 30 mm [m]; none is impossible.
CAUCHY_SCALE = {"sensor_gain": 0.2, "sensor_misalignment": 0.2, "sensor_position": 0.03}
# Standard deviation of a released error in the fit: wide enough to have no effect.
_RELEASED_SPREAD = {"sensor_gain": 5.0, "sensor_misalignment": 3.0, "sensor_position": 0.5}
# Cost of a delay, or of a mount's frequency and damping: log of the number of distinct values.
_SCAN_NATS = {"sensor_delay": 4.0, "mount_resonance": 6.0}
SHAPE_EFFECTS = ("flexible_body", "sensor_unknown")
_N_DELAYS = 16  # delays up to a phase of 2 rad, of both signs
_N_MOUNTS = 18  # frequencies of a mount
# Frequencies of a mount over the highest line: a lower one transmits little of the band, a higher
# one is a small gain.
MOUNT_ENDS = (0.4, 5.0)
_SCANNED_DAMPINGS = (0.03, 0.15)  # damping ratios of a mount


Key = tuple[str, str, str | None]


@dataclass(frozen=True, eq=False)
class BelievedBody:
    """A body as it is believed to be: data, priors, readings and free shapes.

    Args:
        data: channels, exchanged as believed.
        spread: prior standard deviation of each error, wide for released ones; (n_error,).
        reading: reading of each channel per motion at its place; (n_freq, n_channel).
        extra: free shapes; (n_channel, n).
        start: errors at which a fit starts; (n_error,).
        released: errors without tolerance, with the effect that released them.
    """

    data: BodyData
    spread: Real
    reading: Complex
    extra: Real
    start: Real
    released: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @classmethod
    def healthy(cls, data: BodyData, tolerance: Tolerance) -> "BelievedBody":
        """Return the nominal body, with errors within tolerance."""
        sensors = data.sensors
        return cls(
            data,
            sensors.spread(tolerance),
            np.ones((len(data.freq_hz), len(sensors.channels)), complex),
            np.zeros((len(sensors.channels), 0)),
            np.zeros(sensors.count),
        )

    @property
    def model(self) -> RigidFitModel:
        """Model that the fit uses."""
        return RigidFitModel(self.data.sensors, self.data.scale, self.spread, self.extra)

    def penalty(self, errors: Real, tolerance: Tolerance) -> float:
        """Return the cost of released errors relative to errors within tolerance [nats].

        It is the logarithm of the ratio of both prior densities.
        """
        drawn = self.data.sensors.spread(tolerance)
        total = 0.0
        for effect, places in self.released:
            index, half, count = list(places), CAUCHY_SCALE[effect], len(places)
            size = float(np.sum(errors[index] ** 2)) / half**2
            # Cauchy density in one and three dimensions, u = (p / h)^2:
            # 1 / (pi h (1 + u)), 1 / (pi^2 h^3 (1 + u)^2).
            cauchy = {1: np.log(np.pi), 3: 2 * np.log(np.pi)}[count] + count * np.log(half)
            cauchy += (count + 1) / 2 * np.log1p(size)
            normal = np.log(drawn[index]).sum() + count / 2 * np.log(2 * np.pi)
            total += float(cauchy - normal)
        return total


@dataclass(frozen=True, eq=False)
class FaultHypothesis:
    """One fault at one place.

    Args:
        effect: its name.
        location: ``sensor:acc1`` or ``body:ty``.
        dof: directions concerned, such as ``tz`` or ``tx+ty``, or None.
        channels: numbers of the channels, or of the errors, concerned.
        states: function that returns the states to be tried, given the believed one.
        grid: parameters to scan, for a reading that varies along lines; else empty.
        pairs: pairs of channels that are exchanged; a channel paired with itself changes its sign.
        weight: share of the effect's prior probability.
    """

    effect: str
    location: str
    dof: str | None
    channels: tuple[int, ...] = ()
    states: Callable[[BelievedBody], list[BelievedBody]] = lambda state: [state]
    grid: tuple[tuple[float, ...], ...] = ()
    pairs: tuple[tuple[int, int], ...] = ()
    weight: float = 1.0

    @property
    def key(self) -> Key:
        """Effect, place and directions."""
        return self.effect, self.location, self.dof

    @property
    def frees_shape(self) -> bool:
        """Whether the hypothesis has a free amplitude per line."""
        return self.effect in SHAPE_EFFECTS

    @property
    def cost(self) -> float:
        """Prior cost of the hypothesis [nats]."""
        scanned = _SCAN_NATS.get(self.effect, 0.0)
        return scanned - _LOG_PRIOR[self.effect] - float(np.log(self.weight))

    def channel_order(self, count: int) -> tuple[list[int], Real]:
        """Return which channel each of ``count`` channels really is, and its sign."""
        order, signs = list(range(count)), np.ones(count)
        for a, b in self.pairs:
            order[a], order[b] = b, a
            signs[a] = -1.0 if a == b else 1.0
        return order, signs

    def read(self, state: BelievedBody, parameters: tuple[float, ...]) -> BelievedBody:
        """Return the state with this reading on the channels concerned."""
        reading = state.reading.copy()
        reading[:, self.channels] *= READING_RESPONSES[self.effect](
            state.data.freq_hz, *parameters
        )[:, None]
        return replace(state, reading=reading)


def list_hypotheses(state: BelievedBody) -> Iterator[FaultHypothesis]:
    """Yield everything that may be wrong with this body and one or two of its sensors."""
    sensors = state.data.sensors
    mounts = _mount_grid(float(state.data.freq_hz[-1]))
    yield FaultHypothesis("flexible_body", f"body:{state.data.body}", None)
    for k, channel in enumerate(sensors.channels):
        place, dof = f"sensor:{channel.point}", channel.direction[1:]
        yield _release_hypothesis("sensor_gain", place, dof, [k], [np.zeros(1), np.full(1, -0.9)])
        yield _exchange_hypothesis("sensor_polarity", place, dof, [k], [k])
        yield FaultHypothesis("sensor_unknown", place, dof, (k,))
        share = 1 / len(sensors.gains(int(sensors.sensor_of[k])))
        yield FaultHypothesis("mount_resonance", place, dof, (k,), grid=mounts, weight=share)
    for number in range(len(sensors.names)):
        yield from _sensor_hypotheses(sensors, number, state.data.freq_hz)
    yield from _swap_hypotheses(sensors)


def _sensor_hypotheses(sensors: Sensors, number: int, freq_hz: Real) -> Iterator[FaultHypothesis]:
    """Yield the hypotheses on one sensor as a whole."""
    place, gains = f"sensor:{sensors.names[number]}", sensors.gains(number)
    yield _release_hypothesis(
        "sensor_misalignment", place, None, sensors.angles(number), quarter_turns()
    )
    if not sensors.turning[gains].all():
        yield _release_hypothesis(
            "sensor_position", place, None, sensors.offsets(number), [np.zeros(3)]
        )
    top = float(freq_hz[-1])
    yield FaultHypothesis("sensor_delay", place, None, tuple(gains), grid=_delay_grid(top))
    if len(gains) > 1:
        yield FaultHypothesis("mount_resonance", place, None, tuple(gains), grid=_mount_grid(top))
    for a, b in combinations(gains, 2):
        names = "+".join(sensors.channels[c].direction[1:] for c in (a, b))
        yield _exchange_hypothesis("sensor_swap", place, names, [a], [b])


@cache
def quarter_turns() -> tuple[Real, ...]:
    """Return the 24 rotations of a cube as rotation vectors: sensors glued in wrong orientation."""
    turns = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(matrix) > 0:
            turns.append(Rotation.from_matrix(matrix).as_rotvec())
    return tuple(sorted(turns, key=lambda turn: float(np.linalg.norm(turn))))


def mount_response(freq_hz: Real, frequency: float, damping: float) -> Complex:
    """Compute the reading per motion of a sensor on a spring and a damper; (n_freq,).

    It is the transmissibility (1 + 2 i z r) / (1 - r^2 + 2 i z r) with r = f / f0. Spring and
    damper both drive the sensor.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        frequency: natural frequency f0 of the sensor on its mount [Hz].
        damping: damping ratio z of the mount.
    """
    ratio = freq_hz / frequency
    transmitted = 1 + 2j * damping * ratio
    return np.asarray(transmitted / (transmitted - ratio**2), complex)


def delay_response(freq_hz: Real, delay: float) -> Complex:
    """Compute the reading per motion of a delayed channel: exp(-i w delay); (n_freq,).

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        delay: delay [s].
    """
    return np.asarray(np.exp(-2j * np.pi * freq_hz * delay), complex)


READING_RESPONSES: dict[str, Callable[..., Complex]] = {
    "sensor_delay": delay_response,
    "mount_resonance": mount_response,
}


def _delay_grid(top: float) -> tuple[tuple[float, ...], ...]:
    """Return delays of both signs, with a phase of 0.02 to 12 rad at the highest line.

    Beyond 2 rad the phase rotates along the band, so that the steps must not grow.
    """
    turns = np.concatenate([np.geomspace(0.02, 2.0, _N_DELAYS // 2), np.arange(2.4, 12.5, 0.4)])
    sizes = turns / (2 * np.pi * top)
    return tuple((float(size),) for size in np.concatenate([-sizes, sizes]))


def min_parameters(hypothesis: FaultHypothesis, freq_hz: Real) -> tuple[float, ...]:
    """Return the smallest sizes of the parameters of a scan.

    A mount of a lower frequency would read nothing in most of the band.
    """
    if hypothesis.effect == "mount_resonance":
        return MOUNT_ENDS[0] * float(freq_hz[-1]), 1e-3
    return (1e-3 / (2 * np.pi * float(freq_hz[-1])),)


def leave_out_channel(state: BelievedBody, channel: int) -> BelievedBody:
    """Return the body with the readings of one channel left free."""
    shape = np.zeros((len(state.data.scale), 1))
    shape[channel] = 1.0
    return replace(state, extra=np.hstack([state.extra, shape]))


def _mount_grid(top: float) -> tuple[tuple[float, ...], ...]:
    """Return frequencies and dampings of a mount, from 0.4 times the highest line.

    A mount of a lower frequency transmits little in most of the band.
    """
    return tuple(
        (float(f), z) for f in np.geomspace(*MOUNT_ENDS, _N_MOUNTS) * top for z in _SCANNED_DAMPINGS
    )


def _release_hypothesis(
    effect: str, place: str, dof: str | None, errors: list[int], starts: Sequence[Real]
) -> FaultHypothesis:
    """Return the hypothesis that some errors exceed their tolerance."""

    def states(state: BelievedBody) -> list[BelievedBody]:
        spread, candidates = state.spread.copy(), []
        spread[errors] = _RELEASED_SPREAD[effect]
        for start in starts:
            initial = state.start.copy()
            initial[errors] = start
            released = (*state.released, (effect, tuple(errors)))
            candidates.append(replace(state, spread=spread, start=initial, released=released))
        return candidates

    return FaultHypothesis(effect, place, dof, tuple(errors), states)


def _exchange_hypothesis(
    effect: str, place: str, dof: str | None, first: list[int], second: list[int]
) -> FaultHypothesis:
    """Return the hypothesis that channels are exchanged in pairs."""
    pairs = tuple(zip(first, second, strict=True))
    hypothesis = FaultHypothesis(effect, place, dof, (*first, *second), pairs=pairs)

    def states(state: BelievedBody) -> list[BelievedBody]:
        order, signs = hypothesis.channel_order(len(state.data.scale))
        return [replace(state, data=exchange_channels(state.data, order, signs))]

    return replace(hypothesis, states=states)


def _swap_hypotheses(sensors: Sensors) -> Iterator[FaultHypothesis]:
    """Yield exchanges of two sensors that have the same directions."""
    for a, b in combinations(range(len(sensors.names)), 2):
        first = {sensors.channels[c].axis: c for c in sensors.gains(a)}
        second = {sensors.channels[c].axis: c for c in sensors.gains(b)}
        if first.keys() == second.keys():
            axes = sorted(first)
            place = f"sensor:{sensors.names[a]}+{sensors.names[b]}"
            first_channels, second_channels = [first[k] for k in axes], [second[k] for k in axes]
            yield _exchange_hypothesis("sensor_swap", place, None, first_channels, second_channels)
