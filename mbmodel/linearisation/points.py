"""Sensors, hammer points and other named sites of a machine."""

import re
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Layout, Real, is_hammer_point, node_number
from mbmodel.mjcf.names import body_name
from mbmodel.mjcf.stages import stage_numbers

_TRANSMISSIONS_AT_SITES = (mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtTrn.mjTRN_SLIDERCRANK)
_NAMED_ACCELEROMETER = re.compile(r"acc\d+$")


def machine_layout(
    model: mujoco.MjModel, data: mujoco.MjData, stages: list[int], centres: Real, path: Path
) -> tuple[Layout, tuple[str, ...]]:
    """Return bodies and named sites on moving bodies in world axes, and remarks on sites left out.

    A site whose name ends in a number carries the accelerometer of that node. Where several sites
    end in one number, that is the site ``acc<number>``. In a model with such names, a site that a
    tendon or an actuator uses carries none unless it is named so.

    A label such as ``table:+tx`` means a site or a body. A site that has the name of a body is left
    out, and carries no sensor.

    Args:
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (n_body, 3).

    Raises:
        InputError: two sensors or two hammer points of one node, or a body that is named like an
            accelerometer or hammer point, as a site is.
    """
    lead = stage_numbers(model)
    bodies = tuple(body_name(model, stage) for stage in stages)
    moving = [
        s for s in range(model.nsite) if model.site(s).name and lead[model.site_bodyid[s]] in stages
    ]
    names = [str(model.site(s).name) for s in moving]
    anchors = {names[k] for k, s in enumerate(moving) if s in _used_sites(model)}
    hidden = [name for name in names if name in bodies]
    for name in hidden:
        if is_hammer_point(name) or _NAMED_ACCELEROMETER.match(name):
            raise InputError(
                f"{path}: body {name!r} and site {name!r} share a name, and a label such as "
                f"{name}:+tx could mean either: rename one of them"
            )
    points = [name for name in names if name not in hidden]
    without_sensor = _sites_without_sensor(points, anchors)
    _refuse_shared_nodes(path, [name for name in points if name not in without_sensor])
    sites = [s for s, name in zip(moving, names, strict=True) if name not in hidden]
    try:
        layout = Layout(
            bodies=bodies,
            centres=centres,
            points=tuple(points),
            body_of=np.array([stages.index(lead[model.site_bodyid[s]]) for s in sites], np.intp),
            positions=data.site_xpos[sites].reshape(-1, 3),
            axes=data.site_xmat[sites].reshape(-1, 3, 3),
            without_sensor=frozenset(without_sensor),
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}: rename one of them") from error
    return layout, tuple(
        f"site {name!r} has the name of a body: labels such as {name}:+tx mean the body's centre "
        "of mass" + (", and it carries no sensor" if node_number(name) is not None else "")
        for name in hidden
    )


def _used_sites(model: mujoco.MjModel) -> set[int]:
    """Return the numbers of the sites that tendons and actuators use."""
    at_sites = model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE
    used = set(model.wrap_objid[at_sites].tolist())
    for kind, targets in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if mujoco.mjtTrn(kind) in _TRANSMISSIONS_AT_SITES:
            used |= {int(target) for target in targets if target >= 0}
    return used


def _sites_without_sensor(names: list[str], anchors: set[str]) -> set[str]:
    """Return the names of sites that end in a number and carry no accelerometer.

    Args:
        names: of all sites on moving bodies.
        anchors: those that tendons or actuators use.
    """
    accelerometers = {name for name in names if _NAMED_ACCELEROMETER.match(name)}
    nodes = {node_number(name) for name in accelerometers}
    return {
        name
        for name in names
        if name not in accelerometers
        and not is_hammer_point(name)
        and node_number(name) is not None
        and (node_number(name) in nodes or (accelerometers and name in anchors))
    }


def _refuse_shared_nodes(path: Path, names: list[str]) -> None:
    """Raise InputError if two sensors, or two hammer points, have the same node number."""
    site_of_node: dict[tuple[int, bool], str] = {}
    for name in names:
        if (node := node_number(name)) is not None:
            first = site_of_node.setdefault((node, is_hammer_point(name)), name)
            if first != name:
                raise InputError(
                    f"{path}: sites {first!r} and {name!r} both end in node {node}: renumber one"
                )
