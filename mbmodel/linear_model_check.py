"""Check of a linear model against MuJoCo's own forces, so that nothing is left out unseen.

The Parts of a machine hold masses, springs, dampers, gravity, tendons and actuators. MJCF has more
elements, and some act in ways that have no linear model at rest. At static equilibrium with the
velocity v of steady motion, MuJoCo's generalised force r(q, v) = qfrc_passive + qfrc_actuator -
qfrc_bias has the slopes K = -dr/dq and C = -dr/dv, and its mass matrix is M. All three must be
those of the Parts, and the slopes to either side must agree.
"""

from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from identification.words import InputError, Real
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.linearisation.force_slopes import (
    FORCE_DIFFERENCE_STEP,
    choose_difference_step,
    force_scale,
    force_slopes,
    soft_inertia,
    symmetrise_rotations,
)
from mbmodel.machine import Machine
from mbmodel.mjcf.keyframes import pose_data
from mbmodel.mjcf.read import compile_with_remarks
from mbmodel.model import as_drawn

# Relative to the stiffness or damping of the two coordinates: differences are better than 1e-6
# where forces are smooth over some mm.
_MAX_RELATIVE_MISFIT = 1e-4
# Rounding of a force over the step of the differences, with a margin [1/m, 1/rad]: of the largest
# force in the machine, and of what its stiffest spring exerts over a metre.
_FORCE_ROUNDING = 1e-8
_SPRING_ROUNDING = 1e-9
# Of the largest mass [1/s]: a smaller damping has no effect within days.
_DAMPING_RATE_FLOOR = 1e-6
_STEP_RATIO = 10.0  # of two steps that tell a kink of a force from its curvature


def check_linear_model(
    model: mujoco.MjModel, data: mujoco.MjData, machine: Machine, path: Path, velocity: Real
) -> None:
    """Raise InputError if a machine's equation of motion is not MuJoCo's.

    Args:
        data: at static equilibrium.
        machine: linearised there.
        velocity: of the joint coordinates in steady motion [m/s, rad/s]; (nv,).

    Raises:
        InputError: with the joint at which the two differ most.
    """
    drawn = as_drawn(machine)
    matrices = drawn.matrices(drawn.drawn)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    mass += soft_inertia(model, data)
    forces = force_scale(model, data)
    if (coordinate := _worst(machine, matrices.mass, mass, 0.0)) is not None:
        raise InputError(_missing_sentence(path, coordinate, "mass"))
    kinds: tuple[tuple[Literal["position", "velocity"], str, Real], ...] = (
        ("position", "stiffness", matrices.stiffness),
        ("velocity", "damping", matrices.damping),
    )
    fine = choose_difference_step(model, data)
    for along, what, matrix in kinds:
        step = fine if along == "position" else FORCE_DIFFERENCE_STEP
        slope, difference = force_slopes(model, data, along, velocity, step)
        rounding = FORCE_DIFFERENCE_STEP / step
        floor = _SPRING_ROUNDING * rounding * float(np.abs(slope).max()) + (
            _FORCE_ROUNDING * rounding * forces
            if along == "position"
            else _DAMPING_RATE_FLOOR * float(np.abs(mass).max())
        )
        if _exceeds(difference, slope, floor).any():
            _, wider = force_slopes(model, data, along, velocity, _STEP_RATIO * step)
            # Of a smooth force, the difference between the sides grows with the step.
            lasting = np.where(np.abs(wider) < _STEP_RATIO / 3 * np.abs(difference), difference, 0)
            if (coordinate := _worst(machine, lasting, slope, floor, of_zero=True)) is not None:
                raise InputError(
                    f"{path}: at rest the force at joint {coordinate!r} has one {what} to one "
                    "side and another to the other, as at the end of a dead band or a range: "
                    "move the rest away from it"
                )
        if along == "position" and not velocity.any():
            slope = symmetrise_rotations(model, slope)
        if (coordinate := _worst(machine, matrix, slope, floor)) is not None:
            raise InputError(_missing_sentence(path, coordinate, what))


def dynamics_error(machine: Machine) -> float | None:
    """Return how far a linear model is off differences of MuJoCo's own accelerations.

    These are central differences of ``mj_forward`` by position and velocity, at the rest that is
    sought anew. Unlike the check of forces when a machine is read, they go through MuJoCo's
    own mass matrix and constraints.

    Args:
        machine: as it was loaded.

    Returns:
        The largest difference, relative to the largest entry by the same quantity or 1 in its unit;
        None for closed chains, of which MuJoCo's are soft.
    """
    model, _ = compile_with_remarks(machine.source, reading=machine.reading)
    if machine.tree is not None or model.eq_active0.any():
        return None
    start = pose_data(model, machine.keyframe)
    rest = find_equilibrium(model, machine.source, start).data
    nominal = as_drawn(machine)
    matrices = nominal.matrices(nominal.drawn)
    probe = mujoco.MjData(model)

    def accelerations(change: Real, rate: Real) -> Real:
        probe.qpos[:], probe.qvel[:], probe.ctrl[:] = rest.qpos, rate, rest.ctrl
        probe.act[:] = rest.act
        mujoco.mj_integratePos(model, probe.qpos, change, 1.0)
        mujoco.mj_forward(model, probe)
        return probe.qacc.copy()

    none = np.zeros(model.nv)
    fine = choose_difference_step(model, rest)
    worst = 0.0
    for order, (matrix, step) in enumerate(
        ((matrices.stiffness, fine), (matrices.damping, FORCE_DIFFERENCE_STEP))
    ):
        slopes = np.zeros((model.nv, model.nv))
        for column in range(model.nv):
            for sign in (1.0, -1.0):
                moved = sign * step * np.eye(model.nv)[column]
                change, rate = (moved, none) if order == 0 else (none, moved)
                slopes[:, column] += sign * accelerations(change, rate) / (2 * step)
        expected = -np.linalg.solve(matrices.mass, matrix)
        scale = max(float(np.abs(slopes).max(initial=0.0)), 1.0)
        worst = max(worst, float(np.abs(slopes - expected).max(initial=0.0)) / scale)
    return worst


def _missing_sentence(path: Path, coordinate: str, what: str) -> str:
    """Return the sentence on an element that the Parts do not hold."""
    return (
        f"{path}: an element at joint {coordinate!r} adds {what} that the linear model does not "
        "hold: remove the element, or write it with joints, springs and dampers"
    )


def _exceeds(difference: Real, scale: Real, floor: float) -> Real:
    """Return each difference over its tolerance.

    Args:
        difference: of two matrices; (nv, nv).
        scale: a matrix whose rows and columns measure the two coordinates of an entry; (nv, nv).
    """
    sizes = np.abs(scale)
    of_coordinate = np.maximum(sizes.max(axis=0, initial=0.0), sizes.max(axis=1, initial=0.0))
    tolerance = _MAX_RELATIVE_MISFIT * np.sqrt(np.outer(of_coordinate, of_coordinate)) + floor
    excess: Real = np.abs(difference) / np.maximum(tolerance, 1e-300)
    return np.where(excess > 1.0, excess, 0.0)


def _worst(
    machine: Machine, matrix: Real, reference: Real, floor: float, *, of_zero: bool = False
) -> str | None:
    """Return the coordinate at which two matrices differ most, or None if they agree.

    Args:
        machine: with the names of the coordinates.
        matrix: (nv, nv).
        reference: (nv, nv).
        of_zero: whether the matrix must be zero, and the reference is only its scale.
    """
    scale = np.maximum(np.abs(matrix), np.abs(reference))
    excess = _exceeds(matrix if of_zero else matrix - reference, scale, floor)
    if not excess.any():
        return None
    on_diagonal = excess.diagonal()
    worst = on_diagonal if on_diagonal.any() else excess.max(axis=0)
    return machine.coordinates[int(np.argmax(worst))]
