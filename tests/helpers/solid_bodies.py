"""Bodies that move as solids at random, sensors with errors on them, and one fault at most."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from identification_examples import random_layout, read_by_hand
from scipy.spatial.transform import Rotation

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test, Tolerance

HITS = tuple(Dof.parse(text) for text in ("hit:+tx", "hit:+ty", "hit:+tz"))
Readings = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (freq, values) to values


@dataclass(frozen=True)
class Case:
    """What to draw; ``layout_change`` alters the true layout, ``read`` the clean readings.

    ``level`` puts all sensors at one height, axes along those of the world.
    ``planar`` lets the body move along x and z and turn about y alone, axes along the world's.
    ``scatter`` mixes the three hits at random from line to line, as hits beside their place do.
    ``flex`` adds a mode (frequency, size against the rigid motion at its peak, number of shapes).
    """

    seed: int
    sensors: int = 4
    bodies: int = 1
    lines: int = 400
    noise: float = 0.02
    noise_misstated: float = 1.0
    averages: int = 10
    tolerance: Tolerance = field(default_factory=Tolerance)
    layout_change: Callable[[Layout], Layout] | None = None
    read: Readings | None = None
    flex: tuple[float, float] | None = None
    level: bool = False
    planar: bool = False
    scatter: float = 0.0


def motion(rng: np.random.Generator, freq: np.ndarray, bodies: int) -> np.ndarray:
    """Accelerance of the centres, twelve modes from 8 to 250 Hz; (freq, 6 bodies, 3)."""
    poles = np.sort(rng.uniform(8, 250, 12))
    damping = rng.uniform(0.01, 0.06, 12)
    shapes = rng.normal(size=(6 * bodies, 12)) * np.tile([1, 1, 1, 3, 3, 3], bodies)[:, None]
    hits = rng.normal(size=(12, 3))
    ratio = freq[:, None] / poles
    gain = -(ratio**2) / (1 - ratio**2 + 2j * damping * ratio)
    return np.einsum("dm,fm,mk->fdk", shapes, gain, hits)


def tolerated(layout: Layout, tolerance: Tolerance, rng: np.random.Generator) -> Layout:
    """Sensors turned and moved within tolerance."""
    count = len(layout.points)
    turn = Rotation.from_rotvec(tolerance.sensor_angle * rng.normal(size=(count, 3))).as_matrix()
    moved = layout.positions + tolerance.sensor_position * rng.normal(size=(count, 3))
    return replace(layout, axes=turn @ layout.axes, positions=moved)


def triaxials(layout: Layout) -> tuple[Dof, ...]:
    return tuple(Dof.of(point, axis) for point in layout.points for axis in range(3))


def flexible(
    rng: np.random.Generator, freq: np.ndarray, rows: np.ndarray, rigid: np.ndarray, flex
) -> np.ndarray:
    """A mode whose shape no rigid motion holds, forced by what the body does; (freq, out, 3)."""
    pole, size = flex
    shape = rng.normal(size=len(rows))
    shape -= rows @ np.linalg.lstsq(rows, shape, rcond=None)[0]
    shape /= np.linalg.norm(shape)
    forcing = np.einsum("c,fck->fk", rng.normal(size=len(rows)) / np.sqrt(len(rows)), rigid)
    ratio = freq / pole
    gain = ratio**2 / (1 - ratio**2 + 0.03j * ratio)
    mode = shape[:, None] * (gain[:, None] * forcing)[:, None, :]
    near = np.abs(ratio - 1) < 0.05
    relative = np.linalg.norm(mode[near]) / np.linalg.norm(rigid[near])
    return mode * size / relative


def mixed_and_late(case: Case, freq: np.ndarray, values: np.ndarray, rigid) -> np.ndarray:
    """Cross-talk of triaxial sensors, symmetric, and a delay of each channel; within tolerance."""
    rng = np.random.default_rng([case.seed, 17])
    count = values.shape[1] // 3
    pairs = case.tolerance.sensor_cross * rng.normal(size=(count, 3))
    delays = case.tolerance.sensor_delay * rng.normal(size=3 * count)
    mixed = values.copy()
    read = np.array(rigid).reshape(len(freq), count, 3, -1)
    for pair, (a, b) in enumerate([(0, 1), (0, 2), (1, 2)]):
        mixed[:, a::3] += pairs[:, pair, None] * read[:, :, b]
        mixed[:, b::3] += pairs[:, pair, None] * read[:, :, a]
    return mixed * np.exp(-2j * np.pi * freq[:, None] * delays)[:, :, None]


def draw(case: Case) -> Campaign:
    """A campaign of three hits on one axis, noise of H1 known by its variance."""
    rng = np.random.default_rng(case.seed)
    freq = np.linspace(10.0, 200.0, case.lines)
    layout = random_layout(case.seed, n_body=case.bodies, n_sensor=case.sensors)
    if case.planar:
        layout = replace(layout, axes=np.tile(np.eye(3), (len(layout.axes), 1, 1)))
    if case.level:
        flat = layout.positions * [1, 1, 0] + [0, 0, 0.1]
        layout = replace(layout, positions=flat, axes=np.tile(np.eye(3), (len(flat), 1, 1)))
    outputs = triaxials(layout)
    true = tolerated(layout, case.tolerance, rng)
    if case.layout_change is not None:
        true = case.layout_change(true)
    rigid = motion(rng, freq, case.bodies)
    if case.planar:
        rigid[:, [1, 3, 5]] = 0.0
    mixing = np.random.default_rng([case.seed, 23]).normal(size=(len(freq), 3, 3, 2))
    mixing = case.scatter * mixing @ [np.sqrt(0.5), 1j * np.sqrt(0.5)]
    rigid = rigid + rigid @ mixing
    values = np.stack([read_by_hand(true, dof, rigid) for dof in outputs], axis=1)
    if case.flex is not None:
        values = values + flexible(rng, freq, true.rows(outputs), values, case.flex)
    values = values * (1 + case.tolerance.sensor_gain * rng.normal(size=(len(outputs), 1)))
    values = mixed_and_late(case, freq, values, [true.rows(outputs) @ h for h in rigid])
    if case.read is not None:
        values = case.read(freq, values)
    level = case.noise * np.sqrt((np.abs(values) ** 2).mean(axis=1, keepdims=True))
    level = level.mean(axis=0, keepdims=True) * (1 + (30 / freq) ** 2)[:, None, None]
    noise = level * (rng.normal(size=(2, *values.shape)) / np.sqrt(2) * [[[[1]]], [[[1j]]]]).sum(0)
    degrees = 2 * (case.averages - 1)
    common = case.scatter**2 * (np.abs(values) ** 2).sum(axis=2, keepdims=True)
    sampled = (np.broadcast_to(level, values.shape) ** 2 + common) * rng.chisquare(
        degrees, values.shape
    )
    variance = sampled / degrees / case.noise_misstated**2
    return campaign(layout, freq, values + noise, variance, outputs=outputs, case=case)


def campaign(layout, freq, values, variance, *, outputs, case) -> Campaign:
    tests = []
    for k, hit in enumerate(HITS):
        frf = Frf(freq, values[:, :, k : k + 1], outputs, (hit,), "accelerance")
        measured = np.ones((len(outputs), 1), bool)
        estimate = FrfEstimate(
            frf, variance[:, :, k : k + 1], "coherence", measured, averages=case.averages
        )
        tests.append(Test(Condition("drawn.uff", hit), estimate))
    return Campaign("drawn", layout, tuple(tests), case.tolerance)


# Faults, drawn in size and place from a seed; each gives the case and the truth it must find.


@dataclass(frozen=True)
class Truth:
    effect: str
    location: str
    dofs: tuple[str | None, ...] = (None,)


def faulty(kind: str, seed: int, **kwargs) -> tuple[Case, Truth]:
    """One fault of moderate size on one of body0's sensors."""
    rng = np.random.default_rng([seed, sum(map(ord, kind))])
    count = kwargs.get("sensors", 4)
    sensor, axis = int(rng.integers(count)), int(rng.integers(3))
    change, truth = FAULTS[kind](rng, sensor, axis, count)
    return Case(seed, **{**kwargs, **change}), truth


def _read(channels, factor) -> Readings:
    def read(freq, values):
        values = values.copy()
        values[:, channels] *= factor(freq)[:, None, None]
        return values

    return read


def _taken(order) -> Readings:
    return lambda freq, values: values[:, order]


def _at(sensor: int, effect: str, *dofs: str | None) -> Truth:
    return Truth(effect, f"sensor:p0_{sensor}", dofs or (None,))


def _axis(axis: int) -> str:
    return "t" + "xyz"[axis]


def gain(rng, sensor, axis, count):
    factor = float(rng.choice([0.65, 0.75, 1.3, 1.4]))
    read = _read([3 * sensor + axis], lambda f: np.full(len(f), factor))
    return {"read": read}, _at(sensor, "sensor_gain", _axis(axis))


def polarity(rng, sensor, axis, count):
    read = _read([3 * sensor + axis], lambda f: np.full(len(f), -1.0))
    return {"read": read}, _at(sensor, "sensor_polarity", _axis(axis))


def dead(rng, sensor, axis, count):
    read = _read([3 * sensor + axis], lambda f: np.full(len(f), 0.001))
    return {"read": read}, _at(sensor, "dead_channel", _axis(axis))


def _turned(sensor: int, rotation: np.ndarray):
    def change(layout: Layout) -> Layout:
        axes = layout.axes.copy()
        axes[sensor] = Rotation.from_rotvec(rotation).as_matrix() @ axes[sensor]
        return replace(layout, axes=axes)

    return {"layout_change": change}


def misalignment(rng, sensor, axis, count):
    direction = rng.normal(size=3)
    angle = rng.uniform(0.25, 0.5)
    rotation = angle * direction / np.linalg.norm(direction)
    return _turned(sensor, rotation), _at(sensor, "sensor_misalignment")


def quarter_turn(rng, sensor, axis, count):
    layout_axis = np.zeros(3)
    layout_axis[axis] = rng.choice([-1, 1]) * np.pi / 2
    return _turned(sensor, layout_axis), _at(sensor, "sensor_misalignment")


def position(rng, sensor, axis, count):
    direction = rng.normal(size=3)
    offset = rng.uniform(0.08, 0.15) * direction / np.linalg.norm(direction)

    def change(layout: Layout) -> Layout:
        positions = layout.positions.copy()
        positions[sensor] += offset
        return replace(layout, positions=positions)

    return {"layout_change": change}, _at(sensor, "sensor_position")


def swap_channels(rng, sensor, axis, count):
    one, two = sorted([axis, (axis + 1) % 3])
    order = list(range(3 * count))
    order[3 * sensor + one], order[3 * sensor + two] = 3 * sensor + two, 3 * sensor + one
    truth = _at(sensor, "sensor_swap", f"{_axis(one)}+{_axis(two)}")
    return {"read": _taken(order)}, truth


def swap_sensors(rng, sensor, axis, count):
    first, second = sorted(int(k) for k in rng.permutation(count)[:2])
    blocks = [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(count)]
    blocks[first], blocks[second] = blocks[second], blocks[first]
    truth = Truth("sensor_swap", f"sensor:p0_{first}+p0_{second}")
    return {"read": _taken([c for block in blocks for c in block])}, truth


def delay(rng, sensor, axis, count):
    late = float(rng.choice([-1, 1]) * rng.uniform(1e-4, 4e-4))
    channels = [3 * sensor, 3 * sensor + 1, 3 * sensor + 2]
    read = _read(channels, lambda f: np.exp(-2j * np.pi * f * late))
    return {"read": read}, _at(sensor, "sensor_delay")


def _transmitted(pole, damping, f):
    """Motion of a mass on a spring and a damper per motion of what they stand on."""
    ratio = f / pole
    return (1 + 2j * damping * ratio) / (1 - ratio**2 + 2j * damping * ratio)


def mount(rng, sensor, axis, count):
    pole, damping = rng.uniform(300, 600), rng.uniform(0.01, 0.05)

    channels = [3 * sensor, 3 * sensor + 1, 3 * sensor + 2]
    reading = partial(_transmitted, pole, damping)
    return {"read": _read(channels, reading)}, _at(sensor, "mount_resonance")


def mount_in_band(rng, sensor, axis, count):
    pole, damping = rng.uniform(110, 190), rng.uniform(0.02, 0.08)

    truth = _at(sensor, "mount_resonance", _axis(axis))
    return {"read": _read([3 * sensor + axis], partial(_transmitted, pole, damping))}, truth


def flexible_mode(rng, sensor, axis, count):
    flex = (float(rng.uniform(120, 180)), float(rng.uniform(0.03, 0.2)))
    return {"flex": flex}, Truth("flexible_body", "body:body0")


FAULTS = {
    "gain": gain,
    "polarity": polarity,
    "dead": dead,
    "misalignment": misalignment,
    "quarter turn": quarter_turn,
    "position": position,
    "channels exchanged": swap_channels,
    "sensors exchanged": swap_sensors,
    "delay": delay,
    "mount": mount,
    "mount in the band": mount_in_band,
    "flexible": flexible_mode,
}


def only(campaign: Campaign, outputs: list[Dof]) -> Campaign:
    """Return a campaign with these channels alone."""
    return replace(campaign, tests=tuple(part(test, outputs) for test in campaign.tests))


def part(test: Test, outputs: list[Dof], name: str | None = None) -> Test:
    """Return a test with these channels alone, under another name if one is given."""
    estimate = test.estimate
    rows = [estimate.frf.outputs.index(dof) for dof in outputs]
    new = replace(
        estimate,
        frf=estimate.frf.select(outputs, estimate.frf.inputs),
        variance=estimate.variance[:, rows],
        measured=estimate.measured[rows],
    )
    condition = replace(test.condition, test=name or test.condition.test)
    return Test(condition, new)
