"""Random machines whose files have settings, classes and includes that act on what is written.

``compare_with_mujoco`` says how a written file differs from a model in memory, by MuJoCo's own mass
matrix and forces and by the nominal model of the file: nothing of ``mbmodel.writing`` is used.
"""

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from mbmodel import (
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    load_machine,
    sensor_parts,
    spring_parts,
)

SETTINGS = (
    "",
    'settotalmass="77"',
    'boundmass="9" boundinertia="0.2"',
    'inertiafromgeom="true"',
    'balanceinertia="true"',
    'fusestatic="true"',
    'angle="radian" autolimits="false"',
)
DEFAULTS = (
    "",
    '<joint springdamper="0.02 0.3"/>',
    '<joint damping="35" armature="0.4" frictionloss="0"/><site size="0.01"/>',
    '<default class="guide"><joint springdamper="0.01 0.2" stiffness="7"/></default>'
    '<tendon stiffness="3e3" damping="2"/>',
)


def random_machine(seed: int, folder: Path) -> Path:
    """Write a tree of 3 to 6 bodies with random settings, classes, frames and includes."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 7))
    defaults = DEFAULTS[rng.integers(len(DEFAULTS))]
    guide = ' class="guide"' if "guide" in defaults else ""
    parents = [-1, *(int(rng.integers(0, k)) for k in range(1, count))]

    def words(values) -> str:
        return " ".join(f"{value:.17g}" for value in values)

    def turn() -> str:
        return words(Rotation.random(random_state=int(rng.integers(1 << 31))).as_quat())

    def body(k: int) -> str:
        axes = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
        kinds = [("tx", "slide", 0), ("ry", "hinge", 1), ("tz", "slide", 2)]
        joints = "".join(
            f'<joint name="b{k}_{name}" type="{kind}" axis="{words(axes[:, j])}" '
            f'pos="{words(rng.uniform(-0.2, 0.2, 3))}" stiffness="{10 ** rng.uniform(4, 6):.6g}" '
            f'damping="{10 ** rng.uniform(1, 2):.6g}"{guide if rng.random() < 0.5 else ""}/>'
            for name, kind, j in kinds[: int(rng.integers(1, 4))]
        )
        if rng.random() < 0.3:
            joints = (
                f'<frame pos="{words(rng.uniform(-0.1, 0.1, 3))}" quat="{turn()}">{joints}</frame>'
            )
        size = words(rng.uniform(0.05, 0.2, 3))
        mass = f'<geom type="box" size="{size}" mass="{rng.uniform(3, 30):.6g}"/>'
        if rng.random() < 0.5:
            mass += (
                f'<inertial pos="{words(rng.uniform(-0.1, 0.1, 3))}" '
                f'mass="{rng.uniform(3, 30):.6g}" diaginertia="{words(rng.uniform(0.5, 0.7, 3))}"/>'
            )
        site = f'<site name="acc{k + 1}" pos="{words(rng.uniform(-0.3, 0.3, 3))}" quat="{turn()}"/>'
        if rng.random() < 0.3:
            site = f'<frame pos="0.1 0 0.2" quat="{turn()}">{site}</frame>'
        welded = '<body pos="0 0 0.1"><geom size="0.04" mass="1.5"/></body>'
        children = "".join(body(c) for c in range(count) if parents[c] == k)
        return (
            f'<body name="b{k}" pos="{words(rng.uniform(-0.4, 0.4, 3))}" quat="{turn()}">'
            f"{joints}{mass}{site}{welded if rng.random() < 0.3 else ''}{children}</body>"
        )

    compiler = f"<compiler {SETTINGS[rng.integers(len(SETTINGS))]}/>"
    gravity = ("0 0 0", "0 0 -9.81")[int(rng.integers(2))]
    option = f'<option gravity="{gravity}"/>'
    world = f"<worldbody>{body(0)}</worldbody>"
    extra = (
        '<tendon><spatial name="cable" stiffness="2e4" damping="5"><site site="acc1"/>'
        f'<site site="acc{count}"/></spatial></tendon>'
        '<actuator><position name="servo" joint="b0_tx" kp="3e3" dampratio="0.7"/>'
        f'<motor name="push" site="acc{count}" refsite="acc1" gear="1 0.5 0 0 0 0"/></actuator>'
        '<sensor><framepos name="encoder" objtype="site" objname="acc1"/></sensor>'
    )
    free = '<geom contype="0" conaffinity="0"/>'
    blocks = [compiler, option, f"<default>{free}{defaults}</default>", world, extra]
    included = rng.choice(5, size=int(rng.integers(0, 3)), replace=False)
    for number in included:
        (folder / f"part{number}.xml").write_text(f"<mujoco>{blocks[number]}</mujoco>", "utf-8")
        blocks[number] = f'<include file="part{number}.xml"/>'
    path = folder / f"tree{seed}.xml"
    path.write_text(f"<mujoco>{''.join(blocks)}</mujoco>", encoding="utf-8")
    return path


def moved_model(path: Path, seed: int) -> tuple[Model, np.ndarray]:
    """Return a model with everything that tuning varies, and theta away from the drawing."""
    machine = load_machine(path)
    parts = spring_parts(machine) + body_parts(machine) + joint_parts(machine)
    model = Model(machine, parts + sensor_parts(machine))
    rng, theta = np.random.default_rng(seed), model.drawn.copy()
    for k, parameter in enumerate(model.parameters):
        step = float(rng.normal())
        match parameter.known:
            case "free":
                theta[k] *= np.exp(0.3 * step)
            case "mass":
                theta[k] *= 1 + 0.05 * abs(step)
            case "inertia":
                theta[k] += 0.02 * step * abs(theta[k])
            case "com" | "joint_position" | "sensor_position":
                theta[k] += 0.003 * step
            case "sensor_angle":
                theta[k] += 0.02 * step
    return model, theta


def compare_with_mujoco(model: Model, theta: np.ndarray, path: Path) -> float:
    """Return the largest difference of M, C and K over their largest entries."""
    written = as_drawn(load_machine(path))
    order = [written.machine.coordinates.index(name) for name in model.machine.coordinates]
    read, meant = written.matrices(written.drawn), model.matrices(theta)
    errors = [
        np.abs(second[np.ix_(order, order)] - first).max() / np.abs(first).max()
        for first, second in (
            (meant.mass, read.mass),
            (meant.damping, read.damping),
            (meant.stiffness, read.stiffness),
        )
    ]
    alone = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(alone)
    statics = model.at_rest(theta).machine.pose
    data.qpos[:] = alone.qpos0 if statics is None else statics.position
    mujoco.mj_forward(alone, data)
    mass = np.zeros((alone.nv, alone.nv))
    mujoco.mj_fullM(alone, data, mass)
    if statics is not None or not model.machine.gravity.any():
        errors.append(np.abs(mass[np.ix_(order, order)] - meant.mass).max() / meant.mass.max())
    return float(max(errors))
