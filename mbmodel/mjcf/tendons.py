"""How a tendon between sites pulls at the bodies: its elongation per motion of their centres."""

import mujoco
import numpy as np

from identification.words import Real

_PULLEY = -2


def pulls_at_bodies(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    stages: list[int],
    centres: tuple[Real, ...],
) -> dict[int, Real]:
    """Rows t with elongation = t (motion of the centres), of every spatial tendon.

    A straight piece from a to b along the unit vector u stretches by u.(motion of b - motion of
    a); the motion of a point at r from its body's centre is v + w x r. Where a tendon wraps a
    geom, the points of contact count as fixed to it: their sliding changes no length to first
    order. Behind a pulley elongations are divided.

    Args:
        model: the compiled model.
        data: at static equilibrium.
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.

    Returns:
        By the number of the tendon: [1, m]; (6 n_body,). Fixed tendons pull at joints: none.
    """
    return {
        tendon: _pull(model, data, tendon, stages, centres)
        for tendon in range(model.ntendon)
        if not is_fixed(model, tendon)
    }


def is_fixed(model: mujoco.MjModel, tendon: int) -> bool:
    """Whether a tendon couples joint coordinates instead of sites."""
    first = model.wrap_type[model.tendon_adr[tendon]]
    return bool(mujoco.mjtWrap(first) == mujoco.mjtWrap.mjWRAP_JOINT)


def _pull(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    tendon: int,
    stages: list[int],
    centres: tuple[Real, ...],
) -> Real:
    row = np.zeros((len(stages), 6))
    for divisor, points, bodies in branches(model, data, tendon):
        for k in range(len(points) - 1):
            if bodies[k] == bodies[k + 1]:
                continue
            along = points[k + 1] - points[k]
            along /= np.linalg.norm(along) * divisor
            for place, sign in ((k, -1.0), (k + 1, 1.0)):
                stage = model.body_weldid[bodies[place]]
                if stage in stages:
                    number = stages.index(stage)
                    row[number, :3] += sign * along
                    row[number, 3:] += sign * np.cross(points[place] - centres[number], along)
    return row.ravel()


def branches(
    model: mujoco.MjModel, data: mujoco.MjData, tendon: int
) -> list[tuple[float, list[Real], list[int]]]:
    """Divisor, points and their bodies of each branch between pulleys, along the path at rest.

    The path names geoms but not sites, so its sites are taken from the tendon's own list.
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
        if geom == _PULLEY:
            branches.append((next(divisors), [], []))
            continue
        body = model.geom_bodyid[geom] if geom >= 0 else model.site_bodyid[next(sites)]
        branches[-1][1].append(point.copy())
        branches[-1][2].append(int(body))
    return branches
