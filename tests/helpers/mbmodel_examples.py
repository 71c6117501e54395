"""Machines for the tests: the station, the stations of open campaigns, and random skew trees."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import Dof
from mbmodel import FrfRequest, Machine

ROOT = Path(__file__).resolve().parents[2]
STATION = ROOT / "assets" / "microstation" / "station.xml"
CAMPAIGNS = ROOT.parent / "shared" / "campaigns" / "open"
OPEN = sorted(CAMPAIGNS.glob("*/model.xml"))


def mjcf(bodies: str, *, gravity: str = "0 0 0", extra: str = "") -> str:
    """Return a whole MJCF around some bodies."""
    return (
        f'<mujoco model="test"><compiler angle="radian"/><option gravity="{gravity}"/>{extra}'
        f"<worldbody>{bodies}</worldbody></mujoco>"
    )


def numbers(values) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(values))


def mass_on_spring(mass, stiffness, damping, *, name="a", node=1, axis="0 0 1", pos="0 0 0"):
    """Return a body: one mass on one slide."""
    return (
        f'<body name="{name}" pos="{pos}">'
        f'<inertial pos="0 0 0" mass="{mass:.17g}" diaginertia="1 1 1"/>'
        f'<joint name="{name}_j" type="slide" axis="{axis}" stiffness="{stiffness:.17g}" '
        f'damping="{damping:.17g}"/><site name="acc{node}"/></body>'
    )


def taut(stretch, *, start="0.01 0 0.003"):
    """Return a mass at the origin between two taut strings along x, and their tension.

    Strings of different length and of stiffness k1, k2 are stretched by d1, d2 with
    k1 d1 = k2 d2 = N, the tension. The mass is drawn off its balance.
    """
    tension = 3e4 * stretch
    body = (
        '<site name="left" pos="-0.4 0 0"/><site name="right" pos="0.9 0 0"/>'
        f'<body name="bead" pos="{start}"><inertial pos="0 0 0" mass="0.5" diaginertia="1 1 1"/>'
        + "".join(
            f'<joint name="{name}" type="slide" axis="{axis}"/>'
            for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
        )
        + '<site name="acc1"/></body>'
    )
    strings = "".join(
        f'<spatial name="{name}" stiffness="{k}" damping="{c}" springlength="{rest:.17g}">'
        f'<site site="{anchor}"/><site site="acc1"/></spatial>'
        for name, anchor, k, c, rest in (
            ("one", "left", 3e4, 5, 0.4 - tension / 3e4),
            ("two", "right", 1e4, 9, 0.9 - tension / 1e4),
        )
    )
    text = mjcf(body).replace("</mujoco>", f"<tendon>{strings}</tendon></mujoco>")
    return text, tension


def random_tree(seed: int, *, n_body: int | None = None, offset=(0.0, 0.0, 0.0)) -> str:
    """Return a tree of 2 to 6 stages without any alignment, as an MJCF.

    Bodies are turned, axes are skew, each stage has 1 to 6 joints, and one body is welded.
    Stiffness and damping put the modes at some 5 to 500 Hz with damping ratios around 0.01 to 0.1;
    some joints have an armature.
    """
    rng = np.random.default_rng(seed)
    count = n_body or int(rng.integers(2, 7))
    parents = [-1, *(int(rng.integers(0, k)) for k in range(1, count))]
    welded = int(rng.integers(0, count))

    def inertial():
        diagonal = rng.uniform(1.0, 1.6, 3) * rng.uniform(0.5, 3)
        turn = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
        inertia = turn @ np.diag(diagonal) @ turn.T
        full = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        place = numbers(rng.uniform(-0.3, 0.3, 3))
        mass = f"{rng.uniform(5, 60):.17g}"
        return f'<inertial pos="{place}" mass="{mass}" fullinertia="{numbers(full)}"/>'

    def quaternion():
        return numbers(rng.normal(size=4))

    def joints(k):
        chosen = rng.permutation(6)[: int(rng.integers(1, 7))]
        axes = [Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix() for _ in "th"]
        text = ""
        for j in sorted(chosen):
            kind = "slide" if j < 3 else "hinge"
            stiffness = 10 ** rng.uniform(5, 7.5)
            text += (
                f'<joint name="b{k}_{j}" type="{kind}" axis="{numbers(axes[j // 3][:, j % 3])}" '
                f'pos="{numbers(rng.uniform(-0.3, 0.3, 3))}" stiffness="{stiffness:.17g}" '
                f'damping="{stiffness * 10 ** rng.uniform(-4.5, -3.5):.17g}" '
                f'armature="{rng.choice([0.0, 2.5]):.17g}"/>'
            )
        return text

    def site(node):
        return (
            f'<site name="acc{node}" pos="{numbers(rng.uniform(-0.4, 0.4, 3))}" '
            f'quat="{quaternion()}"/>'
        )

    def body(k):
        place = rng.uniform(-0.5, 0.5, 3) + (np.array(offset) if parents[k] < 0 else 0.0)
        inner = inertial() + joints(k) + site(k + 1)
        if k == welded:
            inner += (
                f'<body name="w{k}" pos="{numbers(rng.uniform(-0.3, 0.3, 3))}" '
                f'quat="{quaternion()}">{inertial()}{site(100 + k)}</body>'
            )
        head = f'<body name="b{k}" pos="{numbers(place)}" quat="{quaternion()}">'
        return head + inner + "".join(body(c) for c in range(count) if parents[c] == k) + "</body>"

    return mjcf("".join(body(k) for k in range(count) if parents[k] < 0))


def some_dofs(machine: Machine, count: int, seed: int) -> tuple[Dof, ...]:
    """Return different signed translations and rotations at sensors and bodies."""
    rng = np.random.default_rng(seed)
    places = machine.layout.points + machine.layout.bodies
    every = [Dof.of(point, axis, int(rng.choice([-1, 1]))) for point in places for axis in range(6)]
    return tuple(every[k] for k in rng.permutation(len(every))[:count])


def random_request(machine: Machine, freq_hz, *, n_out=5, n_in=2, seed=1, **fields) -> FrfRequest:
    """Return a request with more outputs than inputs, at random labels."""
    outputs = some_dofs(machine, n_out, seed)
    inputs = some_dofs(machine, n_in, seed + 1000)
    return FrfRequest(np.asarray(freq_hz, float), outputs, inputs, **fields)


def sensor_dofs(machine: Machine) -> tuple[Dof, ...]:
    """Return the three axes of every site."""
    return tuple(Dof.of(point, axis) for point in machine.layout.points for axis in range(3))


def channel_scale(values) -> np.ndarray:
    """Return the peak of every channel over the lines; (1, n_out, n_in).

    A channel's peak is what a test measures: the noise of a sensor does not follow an
    antiresonance, and a single line can be as small as rounding makes it. Channels that are zero
    but for rounding are measured by the largest peak of all channels.
    """
    peak = np.abs(values).max(axis=0)
    largest = peak.max() or 1.0
    return np.where(peak > 1e-10 * largest, peak, largest)[None]


def worst_of_channels(values, expected) -> float:
    """Return the largest error of any channel, relative to that channel's peak over the lines."""
    return float((np.abs(values - expected) / channel_scale(expected)).max())
