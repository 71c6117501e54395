"""Rigid directions on stiff springs: FRFs stay, and one that gives way is the joint in an MJCF."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import Scene
from diagnosis.effects import missing_dof
from mbmodel import (
    AddedPart,
    Model,
    as_drawn,
    load_machine,
    release_rigid_directions,
    spring_parts,
)
from mbmodel.parts import spring_parts as parts_of
from tests.helpers.drawn import drawn, line_by_line

REMOVED = "stage2_ry"
HIGHEST = 160.0


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A tree as drawn, and the same without one hinge."""
    folder = tmp_path_factory.mktemp("loosened")
    session, _ = drawn(folder, 72_001, lines=161)
    path = folder / "campaign" / "model.xml"
    lines = path.read_text().splitlines()
    rigid = path.with_name("rigid.xml")
    rigid.write_text("\n".join(line for line in lines if f'name="{REMOVED}"' not in line))
    return session, load_machine(path), load_machine(rigid)


def at_slope_of_zero(machine, model, part, campaign):
    """How far the derivative while all is held is from what a little of it changes."""
    released = Model(machine, (*model.parts, part))
    theta = np.append(model.drawn, np.zeros(len(part.parameters)))
    little = 1e-9
    ends = [
        line_by_line(released, theta + step * (np.arange(len(theta)) == len(model.drawn)), campaign)
        for step in (0.0, little)
    ]
    change = AddedPart.linear(
        part.location,
        part.parameters[:1],
        tuple(
            replace(change_of_part, core=change_of_part.core[:1])
            for change_of_part in part.derivatives(np.zeros(2))
        ),
    )
    straight = Model(machine, (*model.parts, change))
    far = line_by_line(straight, np.append(model.drawn, little), campaign)
    quotient, slope = ends[1] - ends[0], far - ends[0]
    return np.abs(quotient - slope).max() / np.abs(quotient).max()


def test_rigid_directions_are_what_the_joint_lacks(files):
    _, whole, rigid = files
    same, none = release_rigid_directions(whole, HIGHEST)
    assert same is whole
    assert none == ()
    extended, rigid_directions = release_rigid_directions(rigid, HIGHEST)
    assert [(direction.stage, direction.dof) for direction in rigid_directions] == [
        ("stage2", "ry")
    ]
    assert len(extended.coordinates) == len(whole.coordinates)
    column = whole.jacobian[:, whole.coordinates.index(REMOVED)]
    assert extended.jacobian[:, rigid_directions[0].coordinate] == pytest.approx(column, abs=1e-12)


def test_frfs_stay_while_every_direction_is_rigid(files):
    session, _, rigid = files
    extended, _ = release_rigid_directions(rigid, HIGHEST)
    drawn_frf, rigid_frf = (
        line_by_line(model, model.drawn, session.campaign)
        for model in (as_drawn(rigid), as_drawn(extended))
    )
    assert np.abs(rigid_frf - drawn_frf).max() < 1e-4 * np.abs(drawn_frf).max()
    assert np.abs(rigid_frf - drawn_frf).max() > 0


def test_a_released_direction_is_the_hinge_of_the_mjcf(files):
    session, whole, rigid = files
    extended, rigid_directions = release_rigid_directions(rigid, HIGHEST)
    model = Model(extended, spring_parts(extended))
    scene = Scene(replace(session, model=model), model.drawn, rigid_directions)
    (hypothesis,) = missing_dof.propose(scene)
    assert hypothesis.key == ("missing_dof", "joint:stage2", "ry")
    (part,) = hypothesis.parts
    assert at_slope_of_zero(extended, model, part, session.campaign) < 1e-3
    spring = next(spring for spring in whole.springs if spring.name == REMOVED)
    # Theta for this very spring, from what the hypothesis states of theta = (1, 0) and (1, 1).
    names = [parameter.name for parameter in part.parameters]
    # What nothing shows while all is held must not look as if it had a slope: steps would be wild.
    assert not part.derivatives(np.zeros(2))[0].core[1].any()
    tau = rigid_directions[0].time_constant
    at_one = hypothesis.state(dict(zip(names, (1.0, 0.0), strict=True)))
    at_two = hypothesis.state(dict(zip(names, (1.0, 1.0), strict=True)))
    unit = 1 / at_one["stiffness"] - 1 / rigid_directions[0].stiffness
    compliance = (1 / spring.stiffness - 1 / rigid_directions[0].stiffness) / unit
    step = np.log(at_two["damping"] / at_one["damping"])
    assert at_one["damping"] == pytest.approx(tau * at_one["stiffness"])
    theta = np.array([compliance, np.log(spring.damping / spring.stiffness / tau) / step])
    stated = hypothesis.state(dict(zip(names, theta.tolist(), strict=True)))
    assert stated["stiffness"] == pytest.approx(spring.stiffness, rel=1e-9)
    assert stated["damping"] == pytest.approx(spring.damping, rel=1e-9)
    released = Model(extended, (*parts_of(extended), part))
    values = line_by_line(released, np.append(model.drawn, theta), session.campaign)
    mjcf = as_drawn(whole)
    truth = line_by_line(mjcf, mjcf.drawn, session.campaign)
    assert values == pytest.approx(truth, abs=1e-7 * np.abs(truth).max())
