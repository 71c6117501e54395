"""What may be wrong with one sensor, as a change of what a body's fit takes for granted."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from identification.solid.body_channels import BodyData, exchanged
from identification.solid.rigid_fit import Model
from identification.solid.sensor_errors import Sensors
from identification.words import Complex, Real, Tolerance

# How likely each is before the data are seen, per place. Flexibility is common; the rest are
# mistakes of mounting and cabling, a few in a campaign of twenty sensors.
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
# A released error has a Cauchy prior: half of all wrong gains are within 20 %, turns within some
# 10 degrees, places within 30 mm, and none is impossible.
HALF = {"sensor_gain": 0.2, "sensor_misalignment": 0.2, "sensor_position": 0.03}
# For the fit alone: wide enough to be no prior.
_FREE = {"sensor_gain": 5.0, "sensor_misalignment": 3.0, "sensor_position": 0.5}
# Nats for a delay, or a mount's frequency and damping, found among distinguishable ones.
_SCANNED = {"sensor_delay": 4.0, "mount_resonance": 6.0}
SHAPED = ("flexible_body", "sensor_unknown")
_DELAYS = 16
_MOUNTS = 18
_LOWEST_MOUNT = 0.4  # of the highest line
_DAMPINGS = (0.03, 0.15)


Key = tuple[str, str, str | None]


@dataclass(frozen=True, eq=False)
class State:
    """A body as it is believed to be: data, priors, readings and free shapes.

    Args:
        data: with channels exchanged as believed.
        spread: one standard deviation of each error, released ones wide; (n_error,).
        reading: what each channel reads per motion there; (n_freq, n_channel).
        extra: flexible shapes; (n_channel, n).
        start: where the fit of errors starts; (n_error,).
        released: errors without tolerance, with the effect that released them.
    """

    data: BodyData
    spread: Real
    reading: Complex
    extra: Real
    start: Real
    released: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @classmethod
    def healthy(cls, data: BodyData, tolerance: Tolerance) -> "State":
        """As drawn, within tolerance."""
        sensors = data.sensors
        return cls(
            data,
            sensors.spread(tolerance),
            np.ones((len(data.freq_hz), len(sensors.channels)), complex),
            np.zeros((len(sensors.channels), 0)),
            np.zeros(sensors.count),
        )

    @property
    def model(self) -> Model:
        """What the fit takes for granted."""
        return Model(self.data.sensors, self.data.scale, self.spread, self.extra)

    def penalty(self, errors: Real, tolerance: Tolerance) -> float:
        """Nats that released errors cost beside errors within tolerance: log of two densities."""
        drawn = self.data.sensors.spread(tolerance)
        total = 0.0
        for effect, places in self.released:
            index, half, count = list(places), HALF[effect], len(places)
            size = float(np.sum(errors[index] ** 2)) / half**2
            # Cauchy in one and three dimensions: 1 / (pi h (1 + u)), 1 / (pi^2 h^3 (1 + u)^2).
            cauchy = {1: np.log(np.pi), 3: 2 * np.log(np.pi)}[count] + count * np.log(half)
            cauchy += (count + 1) / 2 * np.log1p(size)
            normal = np.log(drawn[index]).sum() + count / 2 * np.log(2 * np.pi)
            total += float(cauchy - normal)
        return total


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One thing that may be wrong, at one place.

    Args:
        effect: its name.
        location: ``sensor:acc1`` or ``body:ty``.
        dof: directions concerned, such as ``tz`` or ``tx+ty``, or None.
        channels: concerned.
        states: makes the states to try out of the believed one.
        grid: parameters to scan, for a reading that varies along lines; else empty.
        pairs: of channels that are exchanged; one exchanged with itself is turned over.
        weight: share of the effect's prior.
    """

    effect: str
    location: str
    dof: str | None
    channels: tuple[int, ...] = ()
    states: Callable[[State], list[State]] = lambda state: [state]
    grid: tuple[tuple[float, ...], ...] = ()
    pairs: tuple[tuple[int, int], ...] = ()
    weight: float = 1.0

    @property
    def key(self) -> Key:
        """Effect, place and directions."""
        return self.effect, self.location, self.dof

    @property
    def shaped(self) -> bool:
        """Whether it frees an amplitude per line."""
        return self.effect in SHAPED

    @property
    def cost(self) -> float:
        """Nats before the data are seen."""
        scanned = _SCANNED.get(self.effect, 0.0)
        return scanned - _LOG_PRIOR[self.effect] - float(np.log(self.weight))

    def exchange(self, count: int) -> tuple[list[int], Real]:
        """Which channel each of so many really is, and its sign."""
        order, signs = list(range(count)), np.ones(count)
        for a, b in self.pairs:
            order[a], order[b] = b, a
            signs[a] = -1.0 if a == b else 1.0
        return order, signs

    def read(self, state: State, parameters: tuple[float, ...]) -> State:
        """The state with this reading on the channels concerned."""
        new = state.reading.copy()
        new[:, self.channels] *= READINGS[self.effect](state.data.freq_hz, *parameters)[:, None]
        return replace(state, reading=new)


def hypotheses(state: State) -> Iterator[Hypothesis]:
    """Everything that may be wrong with this body and one or two of its sensors."""
    sensors = state.data.sensors
    mounts = _mounts(float(state.data.freq_hz[-1]))
    yield Hypothesis("flexible_body", f"body:{state.data.body}", None)
    for k, channel in enumerate(sensors.channels):
        place, dof = f"sensor:{channel.point}", channel.direction[1:]
        yield _released("sensor_gain", place, dof, [k], [np.zeros(1), np.full(1, -0.9)])
        yield _exchange("sensor_polarity", place, dof, [k], [k])
        yield Hypothesis("sensor_unknown", place, dof, (k,))
        share = 1 / len(sensors.gains(int(sensors.sensor_of[k])))
        yield Hypothesis("mount_resonance", place, dof, (k,), grid=mounts, weight=share)
    for number in range(len(sensors.names)):
        yield from _of_sensor(sensors, number, state.data.freq_hz)
    yield from _whole_swaps(sensors)


def _of_sensor(sensors: Sensors, number: int, freq_hz: Real) -> Iterator[Hypothesis]:
    place, gains = f"sensor:{sensors.names[number]}", sensors.gains(number)
    yield _released("sensor_misalignment", place, None, sensors.angles(number), quarter_turns())
    if not sensors.turning[gains].all():
        yield _released("sensor_position", place, None, sensors.offsets(number), [np.zeros(3)])
    top = float(freq_hz[-1])
    yield Hypothesis("sensor_delay", place, None, tuple(gains), grid=_delays(top))
    if len(gains) > 1:
        yield Hypothesis("mount_resonance", place, None, tuple(gains), grid=_mounts(top))
    for a, b in combinations(gains, 2):
        names = "+".join(sensors.channels[c].direction[1:] for c in (a, b))
        yield _exchange("sensor_swap", place, names, [a], [b])


@cache
def quarter_turns() -> tuple[Real, ...]:
    """The 24 turns of a cube, as rotation vectors: how sensors are glued the wrong way round."""
    turns = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(matrix) > 0:
            turns.append(Rotation.from_matrix(matrix).as_rotvec())
    return tuple(sorted(turns, key=lambda turn: float(np.linalg.norm(turn))))


def mount(freq_hz: Real, frequency: float, damping: float) -> Complex:
    """Reading per motion of a sensor on a spring and a damper: its transmissibility; (n_freq,).

    (1 + 2 i z r) / (1 - r^2 + 2 i z r), r = f / f0: both carry it, so that both drive it.
    """
    ratio = freq_hz / frequency
    carried = 1 + 2j * damping * ratio
    return np.asarray(carried / (carried - ratio**2), complex)


def delayed(freq_hz: Real, delay: float) -> Complex:
    """Reading per motion of a channel that comes later: exp(-i w delay); (n_freq,)."""
    return np.asarray(np.exp(-2j * np.pi * freq_hz * delay), complex)


READINGS: dict[str, Callable[..., Complex]] = {"sensor_delay": delayed, "mount_resonance": mount}


def _delays(top: float) -> tuple[tuple[float, ...], ...]:
    """Late or early by a phase of 0.02 to 12 rad at the highest line.

    Of more than 2 rad the phase turns along the band, so that steps must not be longer.
    """
    turns = np.concatenate([np.geomspace(0.02, 2.0, _DELAYS // 2), np.arange(2.4, 12.5, 0.4)])
    sizes = turns / (2 * np.pi * top)
    return tuple((float(size),) for size in np.concatenate([-sizes, sizes]))


def lowest(one: Hypothesis, freq_hz: Real) -> tuple[float, ...]:
    """Least sizes of the parameters of a scan: below, a mount reads nothing in most of the band."""
    if one.effect == "mount_resonance":
        return _LOWEST_MOUNT * float(freq_hz[-1]), 1e-3
    return (1e-3 / (2 * np.pi * float(freq_hz[-1])),)


def without_channel(state: State, channel: int) -> State:
    """The body, one channel left to itself."""
    shape = np.zeros((len(state.data.scale), 1))
    shape[channel] = 1.0
    return replace(state, extra=np.hstack([state.extra, shape]))


def _mounts(top: float) -> tuple[tuple[float, ...], ...]:
    """On a spring of its own, from 0.4 times the highest line, where little is left above it."""
    return tuple(
        (float(f), z) for f in np.geomspace(_LOWEST_MOUNT, 5.0, _MOUNTS) * top for z in _DAMPINGS
    )


def _released(
    effect: str, place: str, dof: str | None, errors: list[int], starts: Sequence[Real]
) -> Hypothesis:
    def states(state: State) -> list[State]:
        spread, found = state.spread.copy(), []
        spread[errors] = _FREE[effect]
        for start in starts:
            begin = state.start.copy()
            begin[errors] = start
            released = (*state.released, (effect, tuple(errors)))
            found.append(replace(state, spread=spread, start=begin, released=released))
        return found

    return Hypothesis(effect, place, dof, tuple(errors), states)


def _exchange(
    effect: str, place: str, dof: str | None, first: list[int], second: list[int]
) -> Hypothesis:
    """Channels exchanged with others, in pairs."""
    pairs = tuple(zip(first, second, strict=True))
    one = Hypothesis(effect, place, dof, (*first, *second), pairs=pairs)

    def states(state: State) -> list[State]:
        order, signs = one.exchange(len(state.data.scale))
        return [replace(state, data=exchanged(state.data, order, signs))]

    return replace(one, states=states)


def _whole_swaps(sensors: Sensors) -> Iterator[Hypothesis]:
    """Two sensors with the same directions, exchanged."""
    for a, b in combinations(range(len(sensors.names)), 2):
        first = {sensors.channels[c].axis: c for c in sensors.gains(a)}
        second = {sensors.channels[c].axis: c for c in sensors.gains(b)}
        if first.keys() == second.keys():
            axes = sorted(first)
            place = f"sensor:{sensors.names[a]}+{sensors.names[b]}"
            one, other = [first[k] for k in axes], [second[k] for k in axes]
            yield _exchange("sensor_swap", place, None, one, other)
