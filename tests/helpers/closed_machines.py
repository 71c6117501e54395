"""Machines with closed chains, as MJCF: planar linkages, a gear, and platforms on six legs."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY = 9.81


def linkage(
    *, gravity: float = GRAVITY, stiffness: float = 9.0, mass: float = 1.3, damping: float = 0.1
) -> str:
    """Return a four-bar linkage in the plane x z, with springs at both ground joints.

    Crank 0.3 m upright, coupler 0.5 m level, rocker 0.4 m down from it.
    """
    return f"""<mujoco model="linkage"><compiler angle="radian"/>
<option gravity="0 0 {-gravity}"/><worldbody>
<body name="crank"><joint name="crank" type="hinge" axis="0 1 0" stiffness="{stiffness}"
 springref="0.5" damping="{damping}"/>
<inertial pos="0.02 0 0.15" mass="{mass}" diaginertia="0.3 0.2 0.3"/>
<site name="acc1" pos="0.05 0 0.2"/>
<body name="coupler" pos="0 0 0.3"><joint name="pin" type="hinge" axis="0 1 0"/>
<inertial pos="0.25 0 0.03" mass="0.9" diaginertia="0.45 0.3 0.45"/>
<site name="acc2" pos="0.1 0 0.04"/></body></body>
<body name="rocker" pos="0.5 0 -0.1"><joint name="rocker" type="hinge" axis="0 1 0"
 stiffness="4" damping="0.05"/>
<inertial pos="0 0 0.2" mass="0.7" diaginertia="0.15 0.1 0.15"/>
<site name="acc3" pos="0.02 0 0.3"/></body></worldbody>
<equality><connect name="loop" body1="coupler" body2="rocker" anchor="0.5 0 0"/></equality>
</mujoco>"""


def slider_crank() -> str:
    """Return a crank of 0.2 m and a rod of 0.5 m that push a slide, against a preloaded spring."""
    return f"""<mujoco model="slider"><compiler angle="radian"/>
<option gravity="0 0 {-GRAVITY}"/><worldbody>
<body name="crank"><joint name="crank" type="hinge" axis="0 1 0" stiffness="30"/>
<inertial pos="0 0 0.1" mass="2" diaginertia="0.015 0.01 0.015"/>
<body name="rod" pos="0 0 0.2"><joint name="pin" type="hinge" axis="0 1 0"/>
<inertial pos="{np.sqrt(0.21) / 2} 0 -0.1" mass="0.6" diaginertia="0.03 0.02 0.03"/>
</body></body>
<body name="piston" pos="{np.sqrt(0.21)} 0 0"><joint name="piston" type="slide" axis="1 0 0"
 stiffness="200" springref="0.1"/><inertial pos="0 0 0" mass="1.5" diaginertia="1 1 1"/></body>
</worldbody><equality><connect name="wrist" body1="piston" body2="rod" anchor="0 0 0"/></equality>
</mujoco>"""


def geared_pendulum() -> str:
    """Return a pendulum that turns a sprung wheel by 2 q + 0.7 q^2."""
    return f"""<mujoco model="geared"><compiler angle="radian"/>
<option gravity="0 0 {-GRAVITY}"/><worldbody>
<body name="bob"><joint name="bob" type="hinge" axis="0 1 0" springref="0.4" stiffness="3"/>
<inertial pos="0 0 -0.4" mass="2" diaginertia="0.015 0.01 0.015"/></body>
<body name="wheel" pos="1 0 0"><joint name="wheel" type="hinge" axis="0 1 0" stiffness="5"
 springref="0.9" damping="0.2"/><inertial pos="0 0 0" mass="1" diaginertia="0.3 0.3 0.3"/></body>
</worldbody>
<equality><joint name="gear" joint1="wheel" joint2="bob" polycoef="0 2 0.7 0 0"/></equality>
</mujoco>"""


def platform_points() -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper ends of six legs [m]; (6, 3) each."""
    lower = [np.radians(120 * k + side * 50) for k in range(3) for side in (-1, 1)]
    upper = [np.radians(120 * k + side * 15) for k in range(3) for side in (-1, 1)]
    low = np.array([[0.14 * np.cos(a), 0.14 * np.sin(a), 0.0] for a in lower])
    high = np.array([[0.1 * np.cos(a), 0.1 * np.sin(a), 0.16] for a in upper])
    return low, high


def hexapod(
    *,
    leg_mass: float = 0.5,
    stiffness: float = 2e7,
    foot_stiffness: float = 40.0,
    gravity: float = GRAVITY,
    pose: Sequence[float] = (0.0,) * 6,
) -> str:
    """Return a platform on six legs, each of two universal joints and a strut with a motor.

    In another pose it is drawn there anew, by the inverse kinematics of the legs in closed form.

    Args:
        leg_mass: of each half of a leg; 0 for legs without mass [kg].
        stiffness: of each strut [N/m].
        foot_stiffness: of the hinges at each foot [N m/rad].
        gravity: downwards [m/s^2].
        pose: of the platform's slides and hinges in which it is drawn [m, rad]; (6,).
    """
    turns = [Rotation.from_euler(axis, angle) for axis, angle in zip("xyz", pose[3:], strict=True)]
    centre = np.add([0, 0, 0.18], pose[:3])
    turned = turns[0] * turns[1] * turns[2]
    legs, ties, motors, encoders = [], [], [], []
    tops = []
    low, high = platform_points()
    for number, (foot, head) in enumerate(zip(low, high, strict=True), 1):
        along = head - foot
        length = float(np.linalg.norm(along))
        z = along / length
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        drawn = Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
        reach = turned.apply(head - [0, 0, 0.18]) + centre - foot
        stroke = float(np.linalg.norm(reach)) - length
        across, side, up = drawn.inv().apply(reach / (length + stroke))
        first = Rotation.from_euler("x", np.arctan2(-side, up))
        second = Rotation.from_euler("y", np.arcsin(across))
        leg = (drawn * first * second).as_matrix()
        axes = _words(leg[:, :2].T.ravel())
        part = (
            f'<inertial pos="0 0 {length / 4:.17g}" mass="{leg_mass}" '
            f'diaginertia="{0.002 * leg_mass} {0.002 * leg_mass} {0.0002 * leg_mass}"/>'
            if leg_mass
            else ""
        )
        legs.append(
            f'<body name="leg{number}" pos="{_words(foot)}" xyaxes="{axes}">'
            f'<joint name="foot{number}_x" axis="{_words(second.inv().apply([1, 0, 0]))}" '
            f'stiffness="{foot_stiffness}"/>'
            f'<joint name="foot{number}_y" axis="0 1 0" stiffness="{foot_stiffness}"/>{part}'
            f'<body name="strut{number}" pos="0 0 {length / 2 + stroke:.17g}">'
            f'<joint name="strut{number}" type="slide" axis="0 0 1" stiffness="{stiffness}" '
            f'damping="{stiffness * 1e-5}"/>{part}'
            f'<site name="head{number}_strut" pos="0 0 {length / 2:.17g}"/></body></body>'
        )
        tops.append(f'<site name="head{number}_top" pos="{_words(head - [0, 0, 0.18])}"/>')
        ties.append(
            f'<connect name="head{number}" site1="head{number}_strut" site2="head{number}_top"/>'
        )
        motors.append(f'<motor name="motor{number}" joint="strut{number}"/>')
        encoders.append(f'<jointpos name="encoder{number}" joint="strut{number}"/>')
    after = {"rx": turns[1] * turns[2], "ry": turns[2], "rz": Rotation.identity()}
    joints = "".join(
        f'<joint name="platform_{kind}{axis}" type="{"slide" if kind == "t" else "hinge"}" '
        f'axis="{_words(after.get(kind + axis, turned).inv().apply(vector))}"/>'
        for kind in "tr"
        for axis, vector in zip("xyz", np.eye(3), strict=True)
    )
    bound = "" if leg_mass else ' boundmass="1e-12" boundinertia="1e-14"'
    return (
        f'<mujoco model="hexapod"><compiler angle="radian"{bound}/>'
        f'<option gravity="0 0 {-gravity}"/><worldbody>{"".join(legs)}'
        f'<body name="platform" pos="{_words(centre)}" '
        f'quat="{_words(turned.as_quat(scalar_first=True))}">{joints}'
        '<inertial pos="0 0 0.02" mass="15" diaginertia="0.12 0.13 0.2"/>'
        '<site name="acc1" pos="0.1 0 0.03"/><site name="acc2" pos="-0.05 0.09 0.03"/>'
        '<site name="acc3" pos="-0.05 -0.09 0.03"/>'
        f"{''.join(tops)}</body></worldbody><equality>{''.join(ties)}</equality>"
        f"<actuator>{''.join(motors)}</actuator><sensor>{''.join(encoders)}</sensor></mujoco>"
    )


def _words(vector: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in vector)
