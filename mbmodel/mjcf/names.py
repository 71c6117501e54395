"""Names of a compiled MJCF's elements, with substitutes for those that the file does not name."""

import mujoco

from identification.words import UsageError

# Kind of the elements that some equality constraints tie; of the others MuJoCo states it.
_ELEMENT_OF_EQUALITY = {
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "flex": mujoco.mjtObj.mjOBJ_FLEX,
    "flexvert": mujoco.mjtObj.mjOBJ_FLEX,
    "flexstrain": mujoco.mjtObj.mjOBJ_FLEX,
}


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Return the name of a joint; ``<body>_joint<k>`` for the k-th joint of a body if unnamed."""
    if name := model.joint(joint).name:
        return str(name)
    body = model.jnt_bodyid[joint]
    return f"{body_name(model, body)}_joint{joint - model.body_jntadr[body]}"


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Return the name of a body; ``body<number>`` if unnamed."""
    return str(model.body(body).name) or f"body{body}"


def tendon_name(model: mujoco.MjModel, tendon: int) -> str:
    """Return the name of a tendon; ``tendon<number>`` if unnamed."""
    return str(model.tendon(tendon).name) or f"tendon{tendon}"


def actuator_name(model: mujoco.MjModel, actuator: int) -> str:
    """Return the name of an actuator; ``actuator<number>`` if unnamed."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator)
    return name or f"actuator{actuator}"


def coordinate_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the joint coordinates: the joint's name, numbered if it has several."""
    names = [joint_name(model, joint) for joint in model.dof_jntid]
    count = {name: names.count(name) for name in names}
    start = {name: names.index(name) for name in names}
    return tuple(
        name if count[name] == 1 else f"{name}.{k - start[name]}" for k, name in enumerate(names)
    )


def joint_coordinate(compiled: mujoco.MjModel, name: str) -> int:
    """Return the number of a slide's or hinge's coordinate.

    Raises:
        UsageError: there is no such joint.
    """
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    coordinates = {
        joint_name(compiled, joint): int(compiled.jnt_dofadr[joint])
        for joint in range(compiled.njnt)
        if mujoco.mjtJoint(compiled.jnt_type[joint]) in single
    }
    if name not in coordinates:
        raise UsageError(
            f"{name!r} is no slide or hinge of the model: choose one of {', '.join(coordinates)}"
        )
    return coordinates[name]


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom with its body, or of its body if it has none."""
    if geom < 0:
        return "a flexible body"
    body = body_name(model, model.geom_bodyid[geom])
    name = model.geom(geom).name
    return f"geom {name!r} of body {body!r}" if name else f"a geom of body {body!r}"


def equality_name(model: mujoco.MjModel, equality: int) -> str:
    """Return an equality constraint by its name, or else by its kind and the elements it ties."""
    if name := model.equality(equality).name:
        return f"equality constraint {name!r}"
    kind = mujoco.mjtEq(model.eq_type[equality]).name.removeprefix("mjEQ_").lower()
    kind_of_element = _ELEMENT_OF_EQUALITY.get(kind, model.eq_objtype[equality])
    names = [
        mujoco.mj_id2name(model, int(kind_of_element), int(number)) or f"number {number}"
        for number in (model.eq_obj1id[equality], model.eq_obj2id[equality])
        if number >= 0
    ]
    return f"equality constraint ({kind}) of {' and '.join(map(repr, names))}"
