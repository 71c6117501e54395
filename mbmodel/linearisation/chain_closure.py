"""Equality constraints at a pose, as MuJoCo states them, and poses that close them."""

import copy
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Integers, Real
from mbmodel.mjcf.names import equality_name

# Of the largest row: constraints that depend more closely on others repeat them. Rounding of rows
# leaves 1e-15, a chain within 1e-8 rad of a dead centre counts as in it.
MIN_INDEPENDENT_SHARE = 1e-8
_MAX_CLOSING_STEPS = 100
_MAX_CLOSING_STEP = 0.3  # m or rad
_MAX_GAP = 1e-12  # of the machine's size: a chain whose gap is smaller is closed
MAX_REFUSED_GAP = 1e-9  # of the machine's size: beyond it the chain stays open
_CONSTRAINT_STEPS = (
    mujoco.mj_kinematics,
    mujoco.mj_comPos,
    mujoco.mj_flex,
    mujoco.mj_tendon,
    mujoco.mj_makeConstraint,
)
_OTHER_CONSTRAINTS = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_LIMIT
    | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
)


def has_rigid_chains(model: mujoco.MjModel) -> bool:
    """Return whether equality constraints are eliminated: active, but not left to MuJoCo."""
    off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EQUALITY
    return bool(off and model.eq_active0.any())


@dataclass(frozen=True, eq=False)
class Closure:
    """The equality constraints at a pose, as MuJoCo states them.

    Args:
        gap: c [m, rad or units of a tendon]; (n_row,).
        rows: C; (n_row, nv).
        numbers: number of the equality constraint of each row; (n_row,).
    """

    gap: Real
    rows: Real
    numbers: Integers


def read_closure(model: mujoco.MjModel, data: mujoco.MjData, position: Real) -> Closure:
    """Return the equality constraints at a pose.

    Args:
        position: joint positions of the pose; (nq,).
    """
    probe, flags = copy.copy(data), model.opt.disableflags
    probe.qpos[:] = position
    try:
        model.opt.disableflags = (flags | _OTHER_CONSTRAINTS) & ~int(
            mujoco.mjtDisableBit.mjDSBL_EQUALITY
        )
        for step in _CONSTRAINT_STEPS:
            step(model, probe)
    finally:
        model.opt.disableflags = flags
    return Closure(probe.efc_pos.copy(), dense_rows(model, probe), probe.efc_id.astype(np.intp))


def dense_rows(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the Jacobian of all constraints that act; (nefc, nv)."""
    rows = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model) and data.nefc:
        mujoco.mju_sparse2dense(
            rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    elif data.nefc:
        rows[:] = data.efc_J.reshape(rows.shape)
    return rows


def coordinate_lengths(model: mujoco.MjModel) -> Real:
    """Return the machine's size for each translation and 1 for each rotation [m or 1]; (nv,)."""
    kinds = model.jnt_type[model.dof_jntid]
    place = np.arange(model.nv) - model.jnt_dofadr[model.dof_jntid]
    translates = (kinds == mujoco.mjtJoint.mjJNT_SLIDE) | (
        (kinds == mujoco.mjtJoint.mjJNT_FREE) & (place < 3)
    )
    return np.where(translates, max(model.stat.extent, 1e-300), 1.0)


def soft_remarks(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[str, ...]:
    """Return how equality constraints that are left to MuJoCo give way.

    Args:
        data: state at rest, with its forces.
    """
    sentences = []
    numbers = data.efc_id[: data.ne]
    for number in dict.fromkeys(numbers.tolist()):
        row = int(np.argmax(numbers == number))
        stiffness, damping, impedance = (data.efc_KBIP[row, :3] / data.efc_R[row]).tolist()
        inertia = 1 / float(data.efc_R[row])
        sentences.append(
            f"{equality_name(model, number)} gives way as in MuJoCo, with a stiffness of "
            f"{stiffness * impedance / inertia:.3g}, a damping of {damping:.3g} and an inertia of "
            f"{inertia:.3g} across it (SI units of its rows)"
        )
    return tuple(sentences)


def scale_rows(model: mujoco.MjModel, closure: Closure) -> Real:
    """Return C in scaled coordinates, each row of unit size; (n_row, nv)."""
    rows = closure.rows * coordinate_lengths(model)
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    floor = MIN_INDEPENDENT_SHARE * float(sizes.max(initial=0.0))
    return np.where(sizes > floor, rows / np.maximum(sizes, 1e-300), 0.0)


def count_independent(rows: Real) -> int:
    """Return the number of independent rows."""
    values = np.linalg.svd(rows, compute_uv=False)
    return int((values > MIN_INDEPENDENT_SHARE * values.max(initial=0.0)).sum())


def close_chains(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    following: Integers | None = None,
    lengths: Real | None = None,
) -> float:
    """Move a machine until its chains close, by Newton's method; return the remaining gap [1].

    Args:
        data: the pose; moved in place.
        following: coordinates that move; all, as little as possible, if None.
        lengths: motions of the coordinates that count alike; None for the machine's size and 1 rad
            [m, rad]; (nv,).

    Returns:
        The largest gap, relative to the machine's size.
    """
    moving = np.arange(model.nv) if following is None else following
    size = max(model.stat.extent, 1e-300)
    lengths = (coordinate_lengths(model) if lengths is None else lengths)[moving]
    gap = np.inf
    for _ in range(_MAX_CLOSING_STEPS):
        closure = read_closure(model, data, data.qpos)
        gap = float(np.abs(closure.gap).max(initial=0.0)) / size
        if gap <= _MAX_GAP:
            break
        rows = closure.rows[:, moving] * lengths
        step = np.zeros(model.nv)
        step[moving] = lengths * np.linalg.lstsq(rows, -closure.gap, rcond=1e-8)[0]
        step *= min(1.0, _MAX_CLOSING_STEP / max(float(np.abs(step).max()), 1e-300))
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
    return gap


def refuse_open_chains(model: mujoco.MjModel, data: mujoco.MjData, gap: float, path: Path) -> None:
    """Refuse chains that no pose near the drawing closes.

    Args:
        data: the pose that is nearest to closed.
        gap: as ``close_chains`` returns it.
    """
    if gap <= MAX_REFUSED_GAP:
        return
    closure = read_closure(model, data, data.qpos)
    worst = int(np.argmax(np.abs(closure.gap)))
    raise InputError(
        f"{path}: {equality_name(model, int(closure.numbers[worst]))} stays open by "
        f"{abs(closure.gap[worst]):.2g} (m or rad): no pose near the drawing closes it, or it "
        "contradicts other constraints; draw it closed"
    )
