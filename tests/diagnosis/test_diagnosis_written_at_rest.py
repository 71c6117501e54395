"""Effects of a hung machine where tuned wires let it rest elsewhere, which turns its bodies."""

from dataclasses import replace

import numpy as np
import pytest
from hung_machines import hung_chain

from diagnosis import EFFECTS, Scene
from diagnosis.effects.link import Link
from diagnosis.effects.link_place import LinkPlace
from identification.words import Dof
from mbmodel import FrfRequest, Model, WrittenModel, as_drawn, linearise, load_machine, write_model
from tests.diagnosis.test_diagnosis_written import sized
from tests.helpers.drawn import drawn

FREQ = np.array([0.9, 2.0, 5.5, 13.0, 21.0])


@pytest.fixture(scope="module")
def hung(tmp_path_factory):
    """A scene of the hung chain; its campaign stands for what effects read of tests."""
    folder = tmp_path_factory.mktemp("hung")
    session, _ = drawn(folder, 72_001, lines=61)
    (folder / "hung.xml").write_text(hung_chain(), encoding="utf-8")
    session = replace(session, model=as_drawn(load_machine(folder / "hung.xml")))
    return Scene(session, session.model.drawn)


def moved(scene, hypothesis):
    """The model with a hypothesis, at a size that shows, and wires of which one is much softer."""
    model, theta = sized(scene, hypothesis)
    names = [parameter.name for parameter in model.parameters]
    theta[names.index("right.stiffness")] *= 0.3
    pose = model.at_rest(theta).machine.pose
    assert np.abs(pose.turns[0] - np.eye(3)).max() > 1e-3, "the upper body turns"
    return model, theta


@pytest.mark.parametrize("effect", ["appendage", "joint_coupling", "parallel_path"])
def test_effects_are_written_at_the_rest_of_the_fit(hung, tmp_path, effect):
    hypotheses = tuple(EFFECTS[effect](hung))
    for number, hypothesis in enumerate(hypotheses):
        model, theta = moved(hung, hypothesis)
        target = tmp_path / f"{number}.xml"
        assert write_model(model, theta, target) == WrittenModel(target.name), hypothesis.location
    assert hypotheses


def test_a_box_that_is_rigid_across_its_axis_bears_no_weight(hung, tmp_path):
    hypothesis = next(iter(EFFECTS["appendage"](hung)))
    model, theta = moved(hung, hypothesis)
    for number, parameter in enumerate(model.parameters):
        if parameter.name.endswith((".mass_y", ".mass_z")):
            theta[number] = 0.0
        if parameter.name.endswith(".across"):
            theta[number] = 1.0
    assert write_model(model, theta, tmp_path / "box.xml") == WrittenModel("box.xml")


def test_a_body_that_hangs_keeps_the_mass_of_which_wires_carry_the_weight(hung):
    for hypothesis in EFFECTS["appendage"](hung):
        counted = [name for name in hypothesis.bounds if name.endswith(".counted")]
        assert [hypothesis.bounds[name] for name in counted] == [(0.0, 0.0)]


@pytest.fixture(scope="module")
def linked(hung):
    """The model with a link between its bodies, and theta."""
    machine = hung.session.model.machine
    place = LinkPlace(machine, machine.jacobian, (0, 1), 0, machine.layout.centres.mean(axis=0))
    link = Link(place, 30.0)
    model = Model(machine, (*hung.session.model.parts, link.part))
    theta = model.drawn.copy()
    theta[-12:] = 2.0, 3.0, 1.0, 0.2, 0.1, 0.3, 0.1, -0.05, 0.02, 0.2, -0.3, 0.4
    theta[[p.name for p in model.parameters].index("right.stiffness")] *= 0.3
    return model, theta


def test_a_link_between_bodies_that_turn_apart_is_written_as_it_acts(linked, tmp_path):
    model, theta = linked
    turns = model.at_rest(theta).machine.pose.turns
    assert np.abs(turns[0] - turns[1]).max() > 1e-3
    assert write_model(model, theta, tmp_path / "linked.xml") == WrittenModel("linked.xml")


def test_slopes_of_a_link_go_through_the_rest_that_wires_move(linked):
    model, theta = linked
    points = tuple(
        Dof(site, direction) for site in ("acc1", "acc2") for direction in ("+tx", "+tz")
    )
    request = FrfRequest(FREQ, points, points[:2])
    columns = linearise(model, theta, request).columns()
    for number, value in enumerate(theta):
        step = 1e-3 * max(abs(value), 0.1) * np.eye(len(theta))[number]
        there = [linearise(model, theta + m * step, request).values for m in (1, -1, 2, -2)]
        expected = (8 * (there[0] - there[1]) - (there[2] - there[3])) / 12 / step[number]
        error = np.abs(columns[..., number] - expected).max()
        assert error < 1e-5 * np.abs(expected).max(), model.parameters[number].name
