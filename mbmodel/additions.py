"""MJCF elements for dynamics that a machine lacks, equivalent to first order.

    a coupling of joints    K = sum k v v'    fixed tendons with the coefficients v
    a link                                    a tendon between two sites, straight along its axis
    a mass on a spring                        a body on a slide, and such a tendon
    a released direction                      a joint

A tendon between sites half a length before and behind a point p, along the unit vector e, stretches
by e.(motion of the second body at p - motion of the first). A shift along e adds nothing, as
e.(w x e) = 0. Its free length is that at the machine's static equilibrium, so that nothing is
strained there.
"""

from collections.abc import Callable, Mapping

import numpy as np

from identification.words import Real
from mbmodel.machine import WORLD, Axle, Machine
from mbmodel.mjcf.edit import Addition, Element, Values
from mbmodel.parts import Change

_TENDON_LENGTH_M = 1.0  # of a tendon along its axis: any length gives the same linear terms
_MIN_RELATIVE_STIFFNESS = 1e-9  # of the largest: smaller eigenvalues and coefficients are rounding
_GYRATION_RADIUS_M = 1e-3  # of a mass that only slides: MuJoCo needs an inertia above zero

# Attributes of a joint and of a tendon that <default> could set otherwise.
_NO_TENDON_DEFAULTS: Values = {
    "stiffness": "0",
    "damping": "0",
    "armature": "0",
    "frictionloss": "0",
    "limited": "false",
}
_NO_DEFAULTS: Values = {"armature": "0", "frictionloss": "0", "limited": "false"}


def joint_coupling_writer(
    name: str, machine: Machine, finite: Callable[[Real], tuple[Change, ...]]
) -> Callable[[Real], tuple[Addition, ...]]:
    """Return a function that writes a change of joints as springs and dampers between coordinates.

    Args:
        name: of the addition.
        machine: as drawn.
        finite: returns the change at theta.

    Returns:
        A function of theta for ``AddedPart.written``.
    """

    def write(theta: Real) -> tuple[Addition, ...]:
        total = np.zeros((2, *machine.armature.shape))
        for change in finite(theta):
            total += change.left @ change.core[:2] @ change.right.T
        return joint_coupling_elements(name, machine, *total)

    return write


def joint_coupling_elements(
    name: str, machine: Machine, stiffness: Real, damping: Real
) -> tuple[Addition, ...]:
    """Return fixed tendons that act as springs and dampers between joint coordinates.

    Each matrix is split by its eigenvectors, scaled by its diagonal: one tendon per eigenvalue.

    Args:
        name, machine: as for ``joint_coupling_writer``.
        stiffness: to add [N/m, N m/rad, N/rad]; symmetric, (nv, nv).
        damping: to add [N s/m, N m s/rad, N s/rad]; symmetric, (nv, nv).
    """
    elements: list[Addition] = []
    for kind, matrix in (("stiffness", stiffness), ("damping", damping)):
        if not matrix.any():
            continue
        unit = np.sqrt(np.abs(np.diag(matrix)))
        unit[unit == 0] = unit.max() or 1.0
        values, vectors = np.linalg.eigh(matrix / np.outer(unit, unit))
        significant = np.flatnonzero(
            np.abs(values) > _MIN_RELATIVE_STIFFNESS * np.abs(values).max()
        )
        for number, (value, vector) in enumerate(
            zip(values[significant], vectors.T[significant], strict=True)
        ):
            size = float(np.abs(vector * unit).max())
            row = vector * unit / size
            elements.append(
                _fixed_tendon(f"{name}.{kind}{number}", machine, row, kind, value * size**2)
            )
    return tuple(elements)


def _fixed_tendon(name: str, machine: Machine, row: Real, kind: str, size: float) -> Addition:
    """Return a fixed tendon of one stiffness or damping.

    Args:
        row: coefficients of the joint coordinates; (nv,).
        kind: ``stiffness`` or ``damping``.
        size: its value.
    """
    coupled = np.flatnonzero(np.abs(row) > _MIN_RELATIVE_STIFFNESS)
    children = tuple(
        Element(
            "joint", {"joint": machine.written_name(machine.coordinates[k]), "coef": float(row[k])}
        )
        for k in coupled.tolist()
    )
    values: Values = {"name": name, **_NO_TENDON_DEFAULTS, kind: size}
    rest = {joint: drawn.at_rest for joint, drawn in machine.drawing.joints.items()}
    return Addition(name, "tendon", fixed_tendon_at(Element("fixed", values, children), rest))


def fixed_tendon_at(tendon: Element, rest: Mapping[str, float]) -> Element:
    """Return a fixed tendon that is unstrained at a rest.

    MuJoCo computes a free length of -1 itself, so that a negative one turns all coefficients.

    Args:
        tendon: with its joints.
        rest: displacement of the joints by name [m, rad]; 0 of those that are not in it.
    """
    factors = np.array([joint.values["coef"] for joint in tendon.children], float)
    free = float(factors @ [rest.get(str(joint.values["joint"]), 0.0) for joint in tendon.children])
    turned = (factors if free >= 0 else -factors).tolist()
    children = tuple(
        Element("joint", {**joint.values, "coef": factor})
        for joint, factor in zip(tendon.children, turned, strict=True)
    )
    return Element("fixed", {**tendon.values, "springlength": abs(free)}, children)


def link_elements(
    name: str,
    machine: Machine,
    bodies: tuple[str, str],
    along: tuple[Real, Real],
    sizes: Real,
    length: float = _TENDON_LENGTH_M,
) -> tuple[Addition, ...]:
    """Return two sites and a tendon: a spring and a damper between two bodies.

    Args:
        name, machine: as for ``joint_coupling_writer``.
        bodies: names of both; ``world`` for the ground.
        along: its middle and the unit vector of the axis, in world axes [m]; (3,) each.
        sizes: stiffness [N/m] and damping [N s/m].
        length: between the sites [m].
    """
    point, axis = along
    ends = tuple(
        Addition(
            f"{name}.{which}",
            "worldbody" if body == WORLD else body,
            Element("site", {"name": f"{name}.{which}", "pos": _local_position(machine, body, at)}),
            next(each for each in bodies if each != WORLD),
        )
        for which, body, at in zip(
            "ab",
            bodies,
            (point - axis * length / 2, point + axis * length / 2),
            strict=True,
        )
    )
    stiffness, damping = sizes.tolist()
    free: Values = {"springlength": length, "stiffness": stiffness, "damping": damping}
    return (*ends, _spatial_tendon(name, free))


def suspended_mass_elements(
    name: str, machine: Machine, body: str, along: tuple[Real, Real], sizes: Real
) -> tuple[Addition, ...]:
    """Return a mass that slides along an axis of the world, suspended by a spring and a damper.

    The mass is a body on the ground, without weight. So it exerts no force across the axis.

    Args:
        name, machine: as for ``joint_coupling_writer``.
        body: name of the body that it is attached to.
        along: a point of the body and the unit vector, in world axes [m]; (3,) each.
        sizes: mass [kg], stiffness [N/m], damping [N s/m].
    """
    point, axis = along
    end = f"{name}.a"
    moment = float(sizes[0]) * _GYRATION_RADIUS_M**2
    inertia: Values = {
        "pos": "0 0 0",
        "mass": float(sizes[0]),
        "diaginertia": (moment,) * 3,
    }
    frame: Values = {
        "name": name,
        "pos": tuple((point + _TENDON_LENGTH_M * axis).tolist()),
        "gravcomp": "1",
    }
    slide: Values = {
        "name": f"{name}.slide",
        "type": "slide",
        "axis": tuple(axis.tolist()),
        "stiffness": "0",
        "damping": "0",
        **_NO_DEFAULTS,
    }
    children = (
        Element("inertial", inertia),
        Element("joint", slide),
        Element("site", {"name": f"{name}.b"}),
    )
    mass = Element("body", frame, children)
    site = Element("site", {"name": end, "pos": _local_position(machine, body, point)})
    return (
        Addition(end, body, site),
        Addition(name, "worldbody", mass, body),
        _spatial_tendon(
            name,
            {
                "springlength": _TENDON_LENGTH_M,
                "stiffness": float(sizes[1]),
                "damping": float(sizes[2]),
            },
        ),
    )


def point_mass_element(
    name: str, position: Real, mass: float, gravcomp: float, joints: tuple[Element, ...] = ()
) -> Element:
    """Return a body that is a point mass, welded to its parent or on joints.

    Args:
        name: of the body.
        position: in the frame of its parent [m]; (3,).
        mass: [kg].
        gravcomp: share of its weight that is taken off.
        joints: between it and its parent; MuJoCo then needs an inertia above zero.
    """
    moment = mass * _GYRATION_RADIUS_M**2 if joints else 0.0
    inertia: Values = {"pos": "0 0 0", "mass": mass, "diaginertia": (moment,) * 3}
    values: Values = {"name": name, "pos": tuple(position.tolist()), "gravcomp": gravcomp}
    return Element("body", values, (Element("inertial", inertia), *joints))


def directed_mass_elements(
    name: str, machine: Machine, body: str, along: tuple[Real, Real], mass: float
) -> tuple[Addition, ...]:
    """Return a mass without weight that a body feels along one axis alone.

    It is the armature of a tendon from the body to the ground: T' m T with T the motion of the
    point along the axis.

    Args:
        name, machine: as for ``joint_coupling_writer``.
        body: name of the body that feels it.
        along: a point of the body and the unit vector, in world axes [m]; (3,) each.
        mass: [kg].
    """
    point, axis = along
    ends = (body, point), ("worldbody", point + _TENDON_LENGTH_M * axis)
    sites = tuple(
        Addition(
            f"{name}.{which}",
            parent,
            Element(
                "site",
                {
                    "name": f"{name}.{which}",
                    "pos": _local_position(machine, WORLD if parent == "worldbody" else parent, at),
                },
            ),
            body,
        )
        for which, (parent, at) in zip("ab", ends, strict=True)
    )
    return (*sites, _spatial_tendon(name, {"armature": mass}))


def released_joint_elements(
    name: str, machine: Machine, axle: Axle, sizes: Real
) -> tuple[Addition, ...]:
    """Return a joint for a released direction: a hinge or slide along an axle.

    Args:
        name: of the joint.
        machine: as drawn.
        axle: the released direction.
        sizes: stiffness and damping [N/m and N s/m, or N m/rad and N m s/rad].
    """
    body = machine.drawing.bodies[axle.stage]
    values: Values = {
        "name": name,
        "type": "hinge" if axle.turns else "slide",
        "pos": _local_position(machine, axle.stage, axle.anchor),
        "axis": tuple((body.frame.T @ axle.axis).tolist()),
        "stiffness": float(sizes[0]),
        "damping": float(sizes[1]),
        **_NO_DEFAULTS,
    }
    return (Addition(name, axle.stage, Element("joint", values)),)


def _spatial_tendon(name: str, sizes: Values) -> Addition:
    """Return a tendon between the sites ``<name>.a`` and ``<name>.b``.

    Args:
        sizes: its free length [m], stiffness [N/m] and damping [N s/m], or armature [kg].
    """
    sites = tuple(Element("site", {"site": f"{name}.{which}"}) for which in "ab")
    values: Values = {"name": name, **_NO_TENDON_DEFAULTS, **sizes}
    return Addition(name, "tendon", Element("spatial", values, sites))


def _local_position(machine: Machine, body: str, point: Real) -> tuple[float, ...]:
    """Return a point of the world in a body's own frame [m]."""
    if body == WORLD:
        return tuple(point.tolist())
    drawn_body = machine.drawing.bodies[body]
    return tuple((drawn_body.frame.T @ (point - drawn_body.origin)).tolist())
