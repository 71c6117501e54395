"""Machines that hang on wires or are preloaded, as MJCF, and one of them in closed form."""

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81
AXES = (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))


def six_joints(name: str, *, yaw: float) -> str:
    """Three slides and three hinges; only the last has stiffness."""
    return "".join(
        f'<joint name="{name}_{kind}{axis}" '
        f'type="{"slide" if kind == "t" else "hinge"}" axis="{vector}" '
        f'damping="{2 if kind == "t" else 0.02}" '
        f'stiffness="{yaw if (kind, axis) == ("r", "z") else 0}"/>'
        for kind in "tr"
        for axis, vector in AXES
    )


def wire(name: str, first: str, second: str, *, stiffness: float, length: float) -> str:
    """A wire between two sites, unstretched at its length."""
    return (
        f'<spatial name="{name}" stiffness="{stiffness}" damping="20" springlength="{length}">'
        f'<site site="{first}"/><site site="{second}"/></spatial>'
    )


def machine(bodies: str, wires: str, *, gravity: float = GRAVITY) -> str:
    """Return a whole MJCF."""
    return (
        f'<mujoco model="hung"><compiler angle="radian"/><option gravity="0 0 {-gravity}"/>'
        f"<worldbody>{bodies}</worldbody><tendon>{wires}</tendon></mujoco>"
    )


def hung_chain() -> str:
    """Return two bodies, the upper on two wires and the lower on one from its edge."""
    lower = (
        f'<body name="low" pos="0.05 0 -0.5">{six_joints("low", yaw=2.0)}'
        '<inertial pos="0.01 0 -0.08" mass="3" diaginertia="0.02 0.03 0.025"/>'
        '<site name="low_eye"/><site name="acc2" pos="0.1 0.02 -0.05"/></body>'
    )
    upper = (
        f'<body name="up" pos="0 0 -0.8">{six_joints("up", yaw=0.0)}'
        '<inertial pos="0.02 0.01 -0.03" mass="5" diaginertia="0.1 0.12 0.15"/>'
        '<site name="eye1" pos="-0.15 0 0"/><site name="eye2" pos="0.2 0 0"/>'
        '<site name="under" pos="0.05 0 -0.04"/><site name="acc1" pos="0.1 -0.1 0.05"/>'
        f"{lower}</body>"
    )
    hooks = '<site name="hook1" pos="-0.2 0 0"/><site name="hook2" pos="0.25 0 0"/>'
    wires = (
        wire("left", "hook1", "eye1", stiffness=4e4, length=0.8)
        + wire("right", "hook2", "eye2", stiffness=3e4, length=0.8)
        + wire("middle", "under", "low_eye", stiffness=1e4, length=0.459)
    )
    return machine(hooks + upper, wires)


@dataclass(frozen=True)
class Bob:
    """A rigid bob on one wire, that swings in the plane of x and z about y.

    With x the motion of the wire's end, b the bob's rotation about y and the centre of mass h below
    the end, the tension m g and the length at rest L = L0 + m g / k give (double pendulum)

        M = [[m, -m h], [-m h, I + m h^2]],   K = m g [[1 / L, 0], [0, h]],

    and the bounce m z'' + c z' + k z, apart from both.
    """

    stiffness: float = 2e4
    length: float = 0.5
    mass: float = 4.0
    depth: float = 0.1
    inertia: float = 0.03
    slide_damping: float = 2.0
    hinge_damping: float = 0.02
    wire_damping: float = 20.0

    def text(self) -> str:
        """Return the MJCF."""
        body = (
            f'<body name="bob" pos="0 0 {-self.length}">'
            f'<joint name="bob_tx" type="slide" axis="1 0 0" damping="{self.slide_damping}"/>'
            '<joint name="bob_tz" type="slide" axis="0 0 1"/>'
            f'<joint name="bob_ry" type="hinge" axis="0 1 0" damping="{self.hinge_damping}"/>'
            f'<inertial pos="0 0 {-self.depth}" mass="{self.mass}" '
            f'diaginertia="0.05 {self.inertia} 0.04"/><site name="eye"/>'
            f'<site name="acc1" pos="0 0 {-self.depth}"/><site name="acc2" pos="0.1 0 0"/></body>'
        )
        thread = wire("wire", "hook", "eye", stiffness=self.stiffness, length=self.length)
        return machine('<site name="hook"/>' + body, thread)

    def accelerances(self, freq_hz: np.ndarray) -> np.ndarray:
        """Return x and z at acc1 and acc2, per force along x and z at acc1; (n_freq, 4, 2)."""
        m, h, laplace = self.mass, self.depth, 2j * np.pi * freq_hz
        weight = m * GRAVITY
        total = self.length + weight / self.stiffness
        mass = np.array([[m, -m * h], [-m * h, self.inertia + m * h**2]])
        stiffness = weight * np.diag([1 / total, h])
        damping = np.diag([self.slide_damping, self.hinge_damping])
        values = np.zeros((len(freq_hz), 4, 2), complex)
        at_centre = np.array([1.0, -h])
        for k, s in enumerate(laplace):
            swing = np.linalg.solve(s**2 * mass + s * damping + stiffness, at_centre)
            bounce = 1 / (s**2 * m + s * self.wire_damping + self.stiffness)
            values[k] = s**2 * np.array(
                [[at_centre @ swing, 0], [0, bounce], [swing[0], 0], [-0.1 * swing[1], bounce]]
            )
        return values
