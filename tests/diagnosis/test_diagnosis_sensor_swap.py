"""Exchanged channels of one sensor or two that a fit proves; a sensor on another body."""

from dataclasses import replace

import numpy as np
import pytest
from solid_bodies import Case, draw

from diagnosis import Scene, build_verdict, diagnose
from diagnosis.corrections import exchange_channels, mask_channels
from diagnosis.data_checks.sensors import check_sensors
from diagnosis.effects.sensor_swap import propose
from diagnosis.settings import SETTINGS
from identification.words import Dof
from tests.helpers.drawn import drawn
from tuning import predict


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return drawn(tmp_path_factory.mktemp("drawn"), 72_002, lines=41)[0]


def test_gains_of_zero_and_a_transverse_sensitivity_of_one_are_the_exchange(session):
    model, campaign = session.model, session.campaign
    hypothesis = next(iter(propose(Scene(session, model.drawn))))
    site = hypothesis.location.partition(":")[2]
    coordinates = (f"{site}.gain_x", f"{site}.gain_y", f"{site}.cross_xy")
    assert set(hypothesis.scored) <= set(coordinates)
    names = [parameter.name for parameter in model.parameters]
    theta = model.drawn.copy()
    for name, value in zip(coordinates, (0.0, 0.0, 1.0), strict=True):
        theta[names.index(name)] = value
    measured = [test.estimate.frf.values for test in hypothesis.correct(campaign).tests]
    drawn_answers = predict(model, model.drawn, campaign)
    exchanged = predict(model, theta, campaign)
    concerned = [str(dof.positive) for dof in campaign.tests[0].estimate.frf.outputs]
    axes = hypothesis.dof.split("+")
    rows = [concerned.index(f"{site}:+{axis}") for axis in axes]
    for before, after in zip(drawn_answers, exchanged, strict=True):
        np.testing.assert_allclose(after[:, rows], before[:, rows[::-1]], rtol=1e-9, atol=1e-15)
    original = campaign.tests[0].estimate.frf.values
    np.testing.assert_array_equal(measured[0][:, rows], original[:, rows[::-1]])


def test_every_two_channels_of_a_triaxial_sensor_are_proposed(session):
    proposed = [hypothesis.dof for hypothesis in propose(Scene(session, session.model.drawn))]
    sites = {dof.point for dof in session.campaign.outputs}
    assert proposed == ["tx+ty", "tx+tz", "ty+tz"] * len(sites)


@pytest.mark.parametrize(
    ("exchanged", "proposed"),
    [
        ([("acc11:+tx", "acc21:+ty")], [("sensor:acc11+acc21", "tx+ty")]),
        ([("acc11:+tz", "acc12:+tx")], [("sensor:acc11+acc12", "tz+tx")]),
        (
            [(f"acc11:+t{axis}", f"acc22:+t{axis}") for axis in "xyz"],
            [("sensor:acc11+acc22", None)],
        ),
        ([], []),
    ],
)
def test_channels_of_two_sensors_that_fit_exchanged_are_proposed(session, exchanged, proposed):
    answers = predict(session.model, session.model.drawn, session.campaign)
    tests = tuple(
        replace(
            test,
            estimate=replace(test.estimate, frf=replace(test.estimate.frf, values=values)),
        )
        for test, values in zip(session.campaign.tests, answers, strict=True)
    )
    pairs = tuple((Dof.parse(first), Dof.parse(second)) for first, second in exchanged)
    exact = replace(session.campaign, tests=tests)
    scene = Scene(replace(session, campaign=exchange_channels(exact, pairs)), session.model.drawn)
    of_two = [hypothesis for hypothesis in propose(scene) if "+" in hypothesis.location]
    assert [(hypothesis.location, hypothesis.dof) for hypothesis in of_two] == proposed
    for hypothesis in of_two:
        corrected = hypothesis.correct(scene.session.campaign)
        for test, original in zip(corrected.tests, answers, strict=True):
            np.testing.assert_array_equal(test.estimate.frf.values, original)


def test_exchanged_channels_of_two_bodies_are_named(tmp_path):
    # Two sensors on each body leave the data checks nothing to prove.
    session, _ = drawn(tmp_path, 3, None, lines=161, stages=2)
    kept = ("acc11", "acc12", "acc21", "acc22")
    campaign = mask_channels(session.campaign, lambda channel: channel.point not in kept)
    pair = Dof("acc11", "+tx"), Dof("acc21", "+ty")
    campaign = exchange_channels(campaign, (pair,))
    verdict = build_verdict(diagnose(replace(session, campaign=campaign)))
    (cause,) = (cause for cause in verdict.causes if cause.probability >= 0.5)
    assert (cause.effect, cause.location) == ("sensor_swap", "sensor:acc11+acc21")
    assert cause.dof == "tx+ty"


def test_a_sensor_on_another_body_than_drawn_is_left_out_and_named():
    def on_the_other_body(layout):
        return layout.with_point_axes(layout.points[0], layout.axes[0], "body1")

    checks = check_sensors(draw(Case(0, bodies=2, layout_change=on_the_other_body)), SETTINGS)
    assert [(f.effect, f.location) for f in checks.faults] == [("sensor_body", "sensor:p0_0")]
    assert not checks.gross
    assert not checks.small
    for test in checks.campaign.tests:
        for dof, measured in zip(test.estimate.frf.outputs, test.estimate.measured, strict=True):
            assert measured.all() == (dof.point != "p0_0")
    assert any("p0_0 moves with body1, not with body0" in text for text in checks.alive.remarks)
