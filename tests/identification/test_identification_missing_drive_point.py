"""Why shapes have no scale, and how they get one."""

import numpy as np
import pytest

from identification.modal import missing_drive_point_sentence
from identification.words import Dof, Layout

ASKEW = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
LAYOUT = Layout(
    bodies=("floor", "head"),
    centres=np.zeros((2, 3)),
    points=("hit1", "acc1", "acc2", "acc3"),
    body_of=np.array([0, 0, 0, 1]),
    positions=np.array([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.1, 0.0], [0.0, 0.0, 0.4]]),
    axes=np.stack([np.eye(3), np.eye(3), ASKEW, np.eye(3)]),
)


@pytest.mark.parametrize("sensor", ["acc1:+tx", "acc1:-tx"])
def test_a_hit_and_a_sensor_apart_on_one_body_are_named_with_the_remedy(sensor):
    said = missing_drive_point_sentence(LAYOUT, [Dof.parse(sensor)], [Dof.parse("hit1:+tx")])
    assert f"hit1:+tx is hit and {sensor} is read, apart on the one body floor" in said
    assert "state hit1:+tx as acc1:+tx in campaign.toml" in said  # along the force


@pytest.mark.parametrize("sensor", ["acc1:+ty", "acc1:+rz", "acc2:+tx", "acc3:+tx"])
def test_other_bodies_and_other_axes_are_no_drive_point(sensor):
    said = missing_drive_point_sentence(LAYOUT, [Dof.parse(sensor)], [Dof.parse("hit1:+tx")])
    assert said.startswith("No input is measured as an output too")
