"""A body that bends between motors and encoders: as with a coordinate of its own."""

from dataclasses import replace

import numpy as np
import pytest
from mbmodel_examples import STATION

from diagnosis.effects.flexible_body import propose
from diagnosis.effects.held_mode import HeldMode, ModeFamily, find_momenta
from diagnosis.hypothesis import Scene
from diagnosis.scene_points import list_hidden_bodies
from diagnosis.search.linearised_fit import Gained
from diagnosis.search.score_test import rank_scores
from mbmodel import (
    BendingMode,
    FrfRequest,
    Model,
    add_bending_mode,
    linearise,
    load_machine,
    parse_output,
    spring_parts,
)
from tests.helpers.encoder_campaign import write_encoder_campaign
from tuning import open_session

BODY, FREQUENCY, DAMPING = "ty", 92.0, 0.015
HERTZ = np.linspace(4.0, 180.0, 60)


@pytest.fixture(scope="module")
def machine():
    return load_machine(STATION)


def ports_of(machine):
    joints = tuple(parse_output(machine, f"joint:{axle.joint}") for axle in machine.axles)
    return FrfRequest(HERTZ, joints, joints)


def family_of(machine):
    span = find_momenta(machine, BODY, machine.jacobian)
    return ModeFamily(f"{BODY}.mode", f"body:{BODY}", FREQUENCY, span)


def held_mode_of(machine, start):
    return HeldMode(family_of(machine), start)


def test_it_moves_the_joints_as_a_mode_with_a_coordinate_does(machine):
    """Any motion of the body and of what stands on it, with its momentum as the held mode's."""
    extended = add_bending_mode(machine, BODY)
    bending = BendingMode(extended, BODY, FREQUENCY, (), ())
    random = np.random.default_rng(3)
    frames = 0.5 * random.standard_normal(len(bending.names) - 2)
    full = Model(extended, (*spring_parts(extended), bending.part()))
    theta = full.drawn.copy()
    damping = float(np.log(DAMPING / 0.01) / 0.5)
    theta[-len(bending.names) :] = [0.0, damping, *frames]
    expected = linearise(full, theta, ports_of(extended)).values

    moved = sum(
        change.left @ np.tensordot(theta[-len(bending.names) :], change.core, 1)[0]
        for change in bending.part().derivatives(theta[-len(bending.names) :])[1:]
    )
    motion = moved[: len(machine.body_mass), 0]
    mass = float(machine.body_mass[6 * machine.layout.bodies.index(BODY)].max())
    shared = motion @ machine.body_mass @ motion
    momentum = machine.body_mass @ motion / np.sqrt(mass + shared)
    span = find_momenta(machine, BODY, machine.jacobian)
    # What no joint shows of the momentum moves nothing.
    shown = np.linalg.lstsq(machine.jacobian.T @ span, machine.jacobian.T @ momentum, rcond=None)[0]
    size = float(shown @ shown)
    held = held_mode_of(machine, shown / np.sqrt(size))
    bent = 1 - shared / (mass + shared)
    values = [
        100 * size,
        np.log(np.sqrt(bent)) / 0.05,
        np.log(DAMPING * np.sqrt(bent) / 0.03) / 0.5,
    ]
    model = Model(machine, (*spring_parts(machine), held.build()))
    whole = np.append(model.drawn[: -len(held.names)], values)
    whole = np.append(whole, np.zeros(len(held.names) - 3))
    assert linearise(model, whole, ports_of(machine)).values == pytest.approx(expected, rel=1e-8)
    stiff = linearise(model, model.drawn, ports_of(machine)).values
    assert np.abs(stiff / expected - 1).max() > 0.05
    # Nothing of the momentum is hidden here, so that both state the mode of the free body.
    assert size == pytest.approx(shared / (mass + shared))
    free = held.find_free_resonance(whole[-len(held.names) :])
    assert free == pytest.approx((FREQUENCY, DAMPING))


def test_its_slopes_are_exact(machine):
    random = np.random.default_rng(5)
    span = find_momenta(machine, BODY, machine.jacobian)
    start = random.standard_normal(span.shape[1])
    held = held_mode_of(machine, start / np.linalg.norm(start))
    model, count = Model(machine, (*spring_parts(machine), held.build())), len(held.names)
    theta = model.drawn.copy()
    theta[-count:] = np.append([20.0, 1.0, 0.5], 3 * random.standard_normal(count - 3))
    columns = linearise(model, theta, ports_of(machine)).columns()[..., -count:]
    way, ends = random.standard_normal(count), []
    for step in (1e-5, -1e-5):
        moved = theta.copy()
        moved[-count:] += step * way
        ends.append(linearise(model, moved, ports_of(machine)).values)
    slope = (ends[0] - ends[1]) / 2e-5
    assert columns @ way == pytest.approx(slope, rel=1e-5, abs=1e-7 * np.abs(slope).max())


def test_a_member_of_a_family_is_its_mode(machine):
    """The family's entries of size v v' are those of the mode, which its eigenvector gives back."""
    random = np.random.default_rng(7)
    family = family_of(machine)
    v = random.standard_normal(family.span.shape[1])
    v /= np.linalg.norm(v)
    products = 30.0 * np.outer(v, v)[np.triu_indices(len(v))]
    size, direction = family.find_leading(products)
    assert size == pytest.approx(30.0)
    held = held_mode_of(machine, direction)
    momenta = held.find_momentum(np.array([size, *np.zeros(len(v) + 1)]))
    assert list(family.find_products(momenta).values()) == pytest.approx(products)
    values = []
    for part, own in ((held.build(), [size]), (family.build(), products)):
        model = Model(machine, (*spring_parts(machine), part))
        theta = np.zeros(len(model.drawn))
        springs = len(model.drawn) - len(part.parameters)
        theta[:springs] = model.drawn[:springs]
        theta[springs : springs + len(own)] = own
        values.append(linearise(model, theta, ports_of(machine)).values)
    assert values[0] == pytest.approx(values[1], rel=1e-9)


def scene_of(folder, channels, reference):
    """Return the scene of the feed axis with some of its channels and one of its references."""
    write_encoder_campaign(folder, lines=40)
    session = open_session(folder)
    tests = []
    for test in session.campaign.tests:
        outputs = list(map(str, test.estimate.frf.outputs))
        rows = [outputs.index(name) for name in channels]
        if str(test.condition.reference) == reference:
            tests.append(replace(test, estimate=test.estimate.select_outputs(rows)))
    assert tests
    campaign = replace(session.campaign, tests=tuple(tests))
    return Scene(replace(session, campaign=campaign), session.model.drawn)


@pytest.mark.parametrize(
    ("channels", "reference", "bodies"),
    [
        (("encoder", "joint:frame_tx"), "drive", ["frame", "carriage"]),
        (("encoder", "acc2:+tx"), "drive", []),  # the frame carries the accelerometer, too
        (("encoder", "joint:frame_tx"), "hit1:+tz", ["carriage"]),
        (("acc2:+tx", "acc2:+tz"), "hit1:+tz", []),  # a hammer test, for the data checks
    ],
)
def test_bodies_that_no_channel_shows_are_sought(tmp_path, channels, reference, bodies):
    scene = scene_of(tmp_path, channels, reference)
    assert list_hidden_bodies(scene) == bodies
    places = dict.fromkeys(family.location for family in propose(scene))
    assert list(places) == [f"body:{body}" for body in bodies]


def test_a_step_without_a_positive_entry_has_no_gain(tmp_path):
    (family, *_) = propose(scene_of(tmp_path, ("encoder", "joint:frame_tx"), "drive"))
    count = len(family.coordinates)
    against: Gained = 5.0, -np.eye(5)[np.triu_indices(5)][:count]
    towards: Gained = 4.0, np.eye(5)[np.triu_indices(5)][:count]
    first, last = rank_scores([family, family], [against, towards])
    assert (first.gain, last.gain) == (4.0, 0.0)
    assert first.is_of_family
    assert first.hypothesis.coordinates == ("frame.mode0.size",)
