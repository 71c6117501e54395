"""What an answer states where a tolerance already was: true minus drawn, as the contract has it.

An effect is added to a machine that is off its drawing by tolerances. A diagnosis can only find
both together: the axes, the place and the gain that a sensor truly has, against the drawn ones.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from truth.campaign.place_names import named_direction, named_place
from truth.effects import Answer
from truth.effects.effect import Parameter
from truth.machine.rig import Prepared
from truth.machine.station import AXES, Real, Sensor, Station


def subtract_drawing(answer: Answer, drawing: Station, before: Station, after: Prepared) -> Answer:
    """Return the answer with what a drawing says taken off what is true.

    Args:
        answer: of the effect alone.
        drawing: what the user is given.
        before: the true machine without effects.
        after: with all of them.
    """
    _, _, place = answer.location.partition(":")
    parameters: dict[str, Parameter] = dict(answer.parameters)
    if answer.effect in ("sensor_gain", "sensor_misalignment", "sensor_position"):
        drawn, true = (_sensor(station, place) for station in (drawing, after.station))
        if answer.effect == "sensor_gain":
            axis = AXES.index(answer.dof[1])
            parameters["gain"] = float(true.gain[axis] / drawn.gain[axis])
        elif answer.effect == "sensor_position":
            parameters["offset"] = _tuple(true.position - drawn.position)
        else:  # A_true = A_drawn R^T
            turned = Rotation.from_matrix(true.axes.T @ drawn.axes)
            parameters["rotation"] = _tuple(turned.as_rotvec())
    elif answer.effect == "sensor_delay":
        drawn, true = (_sensor(station, place) for station in (drawing, after.station))
        late = float(np.mean(true.delay - drawn.delay))
        parameters["delay"] = late + float(np.asarray(parameters["delay"]))
    elif answer.effect == "hammer_misalignment":
        axis = AXES.index(answer.dof[1])
        node = int("".join(character for character in place if character.isdigit()))
        (hit, *_) = (
            hammer.direction
            for number, hammer in enumerate(after.hammers)
            if hammer.node == node and number % 3 == axis
        )
        parameters["rotation"] = _tuple(_least_turn(drawing.aim_axes(node)[axis], hit))
    elif answer.effect in ("hammer_gain", "hammer_delay"):
        force = after.hammers[0]  # one force channel for all hits
        parameters = _with_channel(parameters, force.gain, force.delay)
    elif answer.effect == "hammer_position":
        parameters["offset"] = _tuple(_offset(drawing, after, place))
    elif answer.effect == "mass_error":
        index = drawing.index(place)
        shift = before.stages[index].com - drawing.stages[index].com
        parameters["position"] = _tuple(np.asarray(answer.parameters["position"]) + shift)
    return replace(answer, parameters=parameters)


def name_sites(answer: Answer, drawing: Station) -> Answer:
    """Return the answer with the drawing's own names of sites instead of ``acc<node>``."""
    return replace(
        answer,
        location=named_place(answer.location, drawing),
        dof=named_direction(answer.dof, drawing),
    )


def _with_channel(values: dict[str, Parameter], gain: float, delay: float) -> dict[str, Parameter]:
    """Return gain or delay of the force channel with what was within tolerance."""
    if "gain" in values:
        return {"gain": gain * float(np.asarray(values["gain"]))}
    return {"delay": delay + float(np.asarray(values["delay"]))}


def _offset(drawing: Station, after: Prepared, site: str) -> Real:
    """Return where the hits of a point lie, the mean over the directions that feel each axis."""
    node = int("".join(character for character in site if character.isdigit()))
    _, point = drawing.aim(node)
    places = np.array([hammer.position for hammer in after.hammers if hammer.node == node])
    # A force along an axis does not feel where along it.
    across = [np.eye(3) - np.outer(axis, axis) for axis in drawing.aim_axes(node)]
    felt = [matrix @ (place - point) for matrix, place in zip(across, places, strict=True)]
    return np.linalg.solve(np.sum(across, axis=0), np.sum(felt, axis=0))


def _sensor(station: Station, site: str) -> Sensor:
    (sensor,) = (candidate for _, candidate in station.sensors() if f"acc{candidate.node}" == site)
    return sensor


def _least_turn(start: Real, end: Real) -> Real:
    """Rotation vector that takes a direction to another; about itself nothing is felt."""
    about = np.cross(start, end)
    size = float(np.linalg.norm(about))
    if size == 0:
        return np.zeros(3)
    return about / size * np.arctan2(size, start @ end)


def _tuple(values: Real) -> tuple[float, ...]:
    return tuple(values.tolist())
