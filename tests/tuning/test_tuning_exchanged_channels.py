"""A sensor whose channels are exchanged or reversed is named with what each channel reads."""

from dataclasses import replace

import pytest

from diagnosis.corrections import exchange_channels
from identification.words import Dof
from tests.helpers.drawn import drawn
from tuning import predict
from tuning.checks.export_faults import name_exchanged_channels


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """A campaign that measured its nominal model without noise, and the model's answers."""
    session = drawn(tmp_path_factory.mktemp("drawn"), 72_002, lines=61)[0]
    answers = predict(session.model, session.model.drawn, session.campaign)
    tests = tuple(map(with_values, session.campaign.tests, answers))
    return replace(session.campaign, tests=tests), answers


def with_values(test, values):
    estimate = test.estimate
    return replace(test, estimate=replace(estimate, frf=replace(estimate.frf, values=values)))


def turned_about_z(campaign, site):
    """The sensor turned by 90 degrees: its channel tx reads +ty, its channel ty reads -tx."""
    pair = tuple(Dof.parse(f"{site}:+{axis}") for axis in ("tx", "ty"))
    exchanged = exchange_channels(campaign, (pair,))
    tests = []
    for test in exchanged.tests:
        frf = test.estimate.frf
        values = frf.values.copy()
        values[:, [dof.positive == pair[1] for dof in frf.outputs]] *= -1
        tests.append(with_values(test, values))
    return replace(campaign, tests=tuple(tests))


def test_right_sensors_are_not_named(exact):
    campaign, answers = exact
    assert name_exchanged_channels(answers, campaign) is None


def test_a_sensor_turned_by_90_degrees_is_named_with_its_axes(exact):
    campaign, answers = exact
    site = campaign.outputs[-1].point
    said = name_exchanged_channels(answers, turned_about_z(campaign, site))
    assert said.startswith(f"{site} reads as if")
    assert "channel tx is +ty" in said
    assert "channel ty is -tx" in said
    assert "tz" not in said
