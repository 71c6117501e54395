"""Machines whose joints slide only: what would turn has a place as soon as it gives way."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import build_verdict, diagnose
from diagnosis.data_checks.check_data import release_session
from mbmodel import model_edits
from tests.helpers.drawn import drawn
from tuning import open_session, predict

WISHES = """
[tuning]
fix = ["stage1_tx.damping", "stage2.joint_position_?"]
free = ["stage3.mass"]
prior = { "stage1_ty.stiffness" = 0.2 }
bounds = { "stage2_tx.stiffness" = [1e6, 1e10] }
tie = [["stage3_t?.stiffness"], ["acc11.gain_?"]]
"""


@pytest.fixture
def session(tmp_path):
    """A tree, the rotations of one stage rigid."""
    return opened(tmp_path, "stage3")


def opened(folder, *stages, wishes=""):
    drawn(folder, 72_001, lines=161)
    folder = folder / "campaign"
    text = (folder / "model.xml").read_text()
    for stage in stages:
        text = re.sub(rf'<joint name="{stage}_r.".*?/>\n', "", text)
    (folder / "model.xml").write_text(text)
    with (folder / "campaign.toml").open("a") as settings:
        settings.write(wishes)
    return open_session(folder)


def measured(session, theta, random):
    """The campaign as it would be at a theta, with noise as large as its own."""
    tests = []
    pairs = zip(
        session.campaign.tests, predict(session.model, theta, session.campaign), strict=True
    )
    for test, values in pairs:
        estimate = test.estimate
        sigma = 0.01 * np.sqrt((np.abs(values) ** 2).mean(axis=(0, 1)))
        error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
        frf = replace(estimate.frf, values=values + error[0] + 1j * error[1])
        variance = np.full(values.shape, sigma**2)
        tests.append(replace(test, estimate=replace(estimate, frf=frf, variance=variance)))
    return replace(session.campaign, tests=tuple(tests))


def test_a_joint_that_may_turn_has_a_place_and_all_that_a_user_wished_stays(tmp_path):
    session = opened(tmp_path, "stage3", wishes=WISHES)
    before, (wider, held) = session.parametrisation, release_session(session)
    after = wider.parametrisation
    assert [one.dof for one in held] == ["rx", "ry", "rz"]
    places = [f"stage3.joint_position_{axis}" for axis in "xyz"]
    assert [p.name for p in after.parameters] == [p.name for p in wider.model.parameters]
    assert after.names == (*before.names, *places)
    for what in ("lower", "upper", "is_tolerance", "precision", "scales", "is_logarithmic"):
        np.testing.assert_array_equal(getattr(after, what)[:-3], getattr(before, what))
    x = np.random.default_rng(4).uniform(-1, 1, after.size)
    theirs = dict(zip((p.name for p in after.parameters), after.theta(x), strict=True))
    for parameter, value in zip(before.parameters, before.theta(x[:-3]), strict=True):
        assert theirs[parameter.name] == value
    tolerance = session.campaign.tolerance.joint_position
    assert [theirs[name] for name in places] == pytest.approx(x[-3:] * tolerance)


def test_where_nothing_is_missing_slides_are_tuned_to_the_noise(session):
    random = np.random.default_rng(7)
    spread = np.where(session.parametrisation.is_tolerance, 0.7, 0.2)
    theta = session.parametrisation.theta(random.normal(0.0, spread))
    session = replace(session, campaign=measured(session, theta, random))
    found = diagnose(session)
    assert build_verdict(found).verdict == "none"
    assert found.null.summary.chi_square == pytest.approx(1.0, abs=0.1)


def test_slides_are_not_written_elsewhere(session):
    wider, _ = release_session(session)
    theta = wider.model.drawn.copy()
    names = [parameter.name for parameter in wider.model.parameters]
    theta[names.index("stage3.joint_position_x")] = 0.004
    assert model_edits(wider.model, theta) == ()
    theta[names.index("stage3.joint_rotation_z")] = 0.01
    drawing = wider.model.machine.drawing
    edits = model_edits(wider.model, theta)
    assert [edit.name for edit in edits] == [f"stage3_t{axis}" for axis in "xyz"]
    for edit in edits:
        assert edit.values["pos"] == tuple(drawing.joints[edit.name].position)
