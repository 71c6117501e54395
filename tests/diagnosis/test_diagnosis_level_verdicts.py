"""Whole diagnoses of one mass at several levels: laws, drift between the levels, and nothing."""

import pytest

from diagnosis import build_verdict, diagnose
from mbmodel import Model, as_drawn, load_machine
from tests.helpers.nonlinear_mass import (
    drifting_campaign,
    level_campaign,
    nonlinear_block,
    session_of,
)


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Model:
    return nonlinear_block(tmp_path_factory.mktemp("mass"))


def test_a_spring_that_stiffens_with_the_level_is_hardening(block):
    cubic = 1.5e15
    campaign = level_campaign(block, lambda stretch: cubic * stretch**3, (20.0, 115.0, 270.0))
    verdict = build_verdict(diagnose(session_of(block, campaign)))
    first = verdict.causes[0]
    assert (first.effect, first.location, first.dof) == ("hardening", "joint:block", "tz")
    assert first.probability > 0.8
    assert first.parameters["k3"] == pytest.approx(cubic, rel=0.25)
    assert [row.level for row in verdict.gap.levels] == [20.0, 115.0, 270.0]
    assert all(row.after.excess < row.retuned.excess for row in verdict.gap.levels)
    foretold = verdict.gap.foretold
    assert foretold.level == 115.0
    assert foretold.after.excess < 1.2 < foretold.retuned.excess
    assert verdict.next_experiment.startswith("repeat the tests at 20 N after all others")


@pytest.mark.parametrize(
    ("levels", "factors"),
    [
        ((20.0, 100.0, 200.0, 20.0), (1.0, 1.03, 1.06, 1.1)),
        ((20.0, 100.0, 200.0, 20.0), (1.0, 0.97, 0.94, 0.91)),
    ],
)
def test_drift_between_levels_is_no_law_where_the_first_level_returns(tmp_path, levels, factors):
    campaign = drifting_campaign(tmp_path, levels, factors)
    machine = as_drawn(load_machine(tmp_path / "visit0.xml"))
    verdict = build_verdict(diagnose(session_of(machine, campaign)))
    first = verdict.causes[0]
    assert (first.effect, first.location, first.dof) == ("drift", "joint:block", "levels")
    assert first.probability > 0.8
    for visit, factor in enumerate(factors[1:], 2):
        assert first.parameters[f"factor_{visit}"] == pytest.approx(factor, rel=0.01)
    assert not verdict.next_experiment.startswith("repeat the tests at 20 N")


def test_drift_between_levels_is_a_rival_of_laws_where_no_level_returns(tmp_path):
    levels, factors = (20.0, 200.0), (1.0, 1.06)
    campaign = drifting_campaign(tmp_path, levels, factors)
    machine = as_drawn(load_machine(tmp_path / "visit0.xml"))
    verdict = build_verdict(diagnose(session_of(machine, campaign)))
    named = {cause.effect: cause.probability for cause in verdict.causes}
    assert named["drift"] > 0.1
    laws = set(named) & {"friction", "backlash", "hardening"}
    twins = [{site.partition("@")[0] for site in pair} for pair in verdict.twins]
    assert all({"drift", law} in twins for law in laws if named[law] > 0.05)
    assert verdict.next_experiment.startswith("repeat the tests at 20 N after all others")


def test_a_linear_machine_at_very_different_levels_lacks_nothing(block):
    campaign = level_campaign(block, None, (3.0, 411.0))
    verdict = build_verdict(diagnose(session_of(block, campaign)))
    assert verdict.verdict == "none"
