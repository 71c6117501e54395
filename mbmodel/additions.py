r"""What a machine lacks as elements that its MJCF can hold, the same to first order.

    a coupling of joints    K = sum k v v'    fixed tendons with the coefficients v
    a link                                    a tendon between two sites, straight along its axis
    a mass on a spring                        a body on a slide, and such a tendon
    a direction that gives way                a joint

A tendon between sites half a length before and behind a point p, along the unit vector e, stretches
by e.(motion of the one body at p - motion of the other): a shift along e adds nothing, as
e.(w x e) = 0. It is as long as it is drawn, so that nothing is strained at rest.
"""

from collections.abc import Callable

import numpy as np

from identification.words import Real
from mbmodel.machine import Axle, Machine
from mbmodel.mjcf.edit import Addition, Element, NotHeld, Values
from mbmodel.parts import Change

_LENGTH = 1.0  # m, of a tendon along its axis
_LITTLE = 1e-9  # of the largest, what counts as no stiffness
_BARE: Values = {"armature": "0", "frictionloss": "0", "limited": "false"}  # whatever the defaults
_TURNING = 1e-3  # m, radius of inertia of a mass that only slides


def by_joints(
    name: str, machine: Machine, finite: Callable[[Real], tuple[Change, ...]]
) -> Callable[[Real], tuple[Addition | NotHeld, ...]]:
    """How a change of joints is written: as springs and dampers between their coordinates.

    Args:
        name: of what is added.
        machine: as drawn.
        finite: the change at theta.
    """

    def written(theta: Real) -> tuple[Addition | NotHeld, ...]:
        total = np.zeros((2, *machine.armature.shape))
        for one in finite(theta):
            total += one.left @ one.core[:2] @ one.right.T
        return coupled(name, machine, *total)

    return written


def coupled(
    name: str, machine: Machine, stiffness: Real, damping: Real
) -> tuple[Addition | NotHeld, ...]:
    """Springs and dampers between joint coordinates.

    Args:
        name: of what is added.
        machine: as drawn.
        stiffness: added [N/m, N m/rad, N/rad]; symmetric, (nv, nv).
        damping: likewise.
    """
    found: list[Addition | NotHeld] = []
    for kind, matrix in (("stiffness", stiffness), ("damping", damping)):
        if not matrix.any():
            continue
        unit = np.sqrt(np.abs(np.diag(matrix)))
        unit[unit == 0] = unit.max() or 1.0
        values, vectors = np.linalg.eigh(matrix / np.outer(unit, unit))
        kept = np.flatnonzero(np.abs(values) > _LITTLE * np.abs(values).max())
        for number, (value, vector) in enumerate(zip(values[kept], vectors.T[kept], strict=True)):
            size = float(np.abs(vector * unit).max())
            row = vector * unit / size
            found.append(_fixed(f"{name}.{kind}{number}", machine, row, kind, value * size**2))
    return tuple(found)


def _fixed(name: str, machine: Machine, row: Real, kind: str, size: float) -> Addition | NotHeld:
    chosen = np.flatnonzero(np.abs(row) > _LITTLE)
    joints = [machine.coordinates[k] for k in chosen]
    strange = [joint for joint in joints if joint not in machine.drawing.joints]
    if strange:
        return NotHeld(name, f"{strange[0]} is no joint of the file")
    if len(joints) == 1 and size < 0:
        return NotHeld(name, f"take {-size:.4g} from the {kind} of joint {joints[0]}")
    children = tuple(
        Element("joint", {"joint": joint, "coef": float(row[k])})
        for joint, k in zip(joints, chosen, strict=True)
    )
    return Addition(name, "tendon", Element("fixed", {"name": name, kind: size}, children))


def linked(
    name: str, machine: Machine, bodies: tuple[str, str], along: tuple[Real, Real], sizes: Real
) -> tuple[Addition, ...]:
    """A spring and a damper between two bodies.

    Args:
        name: of what is added.
        machine: as drawn.
        bodies: names of both.
        along: a point and the unit vector of the axis, in world axes [m]; (3,) each.
        sizes: stiffness [N/m] and damping [N s/m].
    """
    point, axis = along
    ends = tuple(
        Addition(
            f"{name}.{which}",
            body,
            Element("site", {"name": f"{name}.{which}", "pos": _local(machine, body, at)}),
        )
        for which, body, at in zip(
            "ab",
            bodies,
            (point - axis * _LENGTH / 2, point + axis * _LENGTH / 2),
            strict=True,
        )
    )
    return (*ends, _tendon(name, sizes))


def hung(
    name: str, machine: Machine, body: str, along: tuple[Real, Real], sizes: Real
) -> tuple[Addition, ...]:
    """A mass that slides along an axis of the world, on a spring and a damper.

    Its body stands on the ground, so that across the axis nobody feels it, and floats.

    Args:
        name: of what is added.
        machine: as drawn.
        body: that it hangs on.
        along: a point of the body and the unit vector, in world axes [m]; (3,) each.
        sizes: mass [kg], stiffness [N/m], damping [N s/m].
    """
    point, axis = along
    end = f"{name}.a"
    moment = float(sizes[0]) * _TURNING**2
    inertia: Values = {
        "pos": "0 0 0",
        "mass": float(sizes[0]),
        "diaginertia": (moment,) * 3,
    }
    frame: Values = {
        "name": name,
        "pos": tuple((point + _LENGTH * axis).tolist()),
        "gravcomp": "1",
    }
    slide: Values = {
        "name": f"{name}.slide",
        "type": "slide",
        "axis": tuple(axis.tolist()),
        "stiffness": "0",
        "damping": "0",
        **_BARE,
    }
    children = (
        Element("inertial", inertia),
        Element("joint", slide),
        Element("site", {"name": f"{name}.b"}),
    )
    mass = Element("body", frame, children)
    site = Element("site", {"name": end, "pos": _local(machine, body, point)})
    return (
        Addition(end, body, site),
        Addition(name, "worldbody", mass),
        _tendon(name, sizes[1:]),
    )


def freed(name: str, machine: Machine, axle: Axle, sizes: Real) -> tuple[Addition, ...]:
    """A joint more, that turns or slides along an axle.

    Args:
        name: of what is added.
        machine: as drawn.
        axle: where.
        sizes: stiffness and damping [N/m, N s/m, or about the axle].
    """
    heavy = machine.drawing.bodies[axle.stage]
    values: Values = {
        "name": name,
        "type": "hinge" if axle.turns else "slide",
        "pos": _local(machine, axle.stage, axle.anchor),
        "axis": tuple((heavy.frame.T @ axle.axis).tolist()),
        "stiffness": float(sizes[0]),
        "damping": float(sizes[1]),
        **_BARE,
    }
    return (Addition(name, axle.stage, Element("joint", values)),)


def _tendon(name: str, sizes: Real) -> Addition:
    sites = tuple(Element("site", {"site": f"{name}.{which}"}) for which in "ab")
    values: Values = {"name": name, "stiffness": float(sizes[0]), "damping": float(sizes[1])}
    return Addition(name, "tendon", Element("spatial", values, sites))


def _local(machine: Machine, body: str, point: Real) -> tuple[float, ...]:
    """A point of the world in a body's own frame."""
    heavy = machine.drawing.bodies[body]
    return tuple((heavy.frame.T @ (point - heavy.origin)).tolist())
