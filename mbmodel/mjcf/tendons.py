"""Elongation of tendons between sites per motion of the bodies' centres, and their paths."""

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.stages import stage_of

_WRAP_PULLEY = -2  # MuJoCo's mark in ``wrap_obj`` for a pulley


def tendon_body_jacobian(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    stages: list[int],
    centres: tuple[Real, ...],
) -> dict[int, Real]:
    """Return rows t with elongation = t (motion of the centres of mass), for every spatial tendon.

    A straight piece from a to b along the unit vector u stretches by ``u.(motion of b - motion of
    a)``; the motion of a point at r from its body's centre is ``v + w x r``. Where a tendon wraps a
    geom, the points of contact count as fixed to the geom: to first order their sliding does not
    change the length. Behind a pulley the elongation is divided by the pulley's divisor.

    Args:
        data: at static equilibrium.
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.

    Returns:
        Rows by the number of the tendon [1, m]; (6 n_body,). Fixed tendons act at joints and are
        left out.
    """
    return {
        tendon: _pull(model, data, tendon, stages, centres)
        for tendon in range(model.ntendon)
        if not is_fixed_tendon(model, tendon)
    }


def is_fixed_tendon(model: mujoco.MjModel, tendon: int) -> bool:
    """Return whether a tendon couples joint coordinates instead of sites."""
    first = model.wrap_type[model.tendon_adr[tendon]]
    return bool(mujoco.mjtWrap(first) == mujoco.mjtWrap.mjWRAP_JOINT)


def _pull(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    tendon: int,
    stages: list[int],
    centres: tuple[Real, ...],
) -> Real:
    """Return the row of one spatial tendon; (6 n_body,)."""
    row = np.zeros((len(stages), 6))
    for divisor, points, bodies in tendon_branches(model, data, tendon):
        for k in range(len(points) - 1):
            if bodies[k] == bodies[k + 1]:
                continue
            along = points[k + 1] - points[k]
            along /= np.linalg.norm(along) * divisor
            for place, sign in ((k, -1.0), (k + 1, 1.0)):
                stage = stage_of(model, bodies[place])
                if stage in stages:
                    number = stages.index(stage)
                    row[number, :3] += sign * along
                    row[number, 3:] += sign * np.cross(points[place] - centres[number], along)
    return row.ravel()


def tendon_branches(
    model: mujoco.MjModel, data: mujoco.MjData, tendon: int
) -> list[tuple[float, list[Real], list[int]]]:
    """Return divisor, points and bodies of each branch between pulleys, along the path at rest.

    MuJoCo's path names geoms but not sites, so the sites are taken from the tendon's own list.

    Args:
        data: at static equilibrium.
        tendon: number of a spatial tendon.

    Returns:
        One tuple a branch: divisor of its pulley, points [m] (3,) each, MJCF body of each point.
    """
    start, count = data.ten_wrapadr[tendon], data.ten_wrapnum[tendon]
    points = data.wrap_xpos.reshape(-1, 3)[start : start + count]
    geoms = data.wrap_obj.reshape(-1)[start : start + count]
    first, number = model.tendon_adr[tendon], model.tendon_num[tendon]
    wraps = [(mujoco.mjtWrap(model.wrap_type[k]), k) for k in range(first, first + number)]
    sites = iter(model.wrap_objid[k] for kind, k in wraps if kind == mujoco.mjtWrap.mjWRAP_SITE)
    divisors = iter(
        float(model.wrap_prm[k]) for kind, k in wraps if kind == mujoco.mjtWrap.mjWRAP_PULLEY
    )
    branches: list[tuple[float, list[Real], list[int]]] = [(1.0, [], [])]
    for point, geom in zip(points, geoms, strict=True):
        if geom == _WRAP_PULLEY:
            branches.append((next(divisors), [], []))
            continue
        body = model.geom_bodyid[geom] if geom >= 0 else model.site_bodyid[next(sites)]
        branches[-1][1].append(point.copy())
        branches[-1][2].append(int(body))
    return branches
