"""The background of small imperfections: what it changes, how much of it is left, what is told."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from truth.background.draw import AskewGuides, Background, ChannelDelays, draw_background
from truth.campaign.background_sizing import mean_error, size_background
from truth.campaign.cause import Cause, Wanted
from truth.campaign.draw import Tolerances, draw_hammers
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.protocol import Protocol, takes
from truth.campaign.survival import refit_of
from truth.campaign.virtual_test import Plan, draw_campaign
from truth.errors import TruthError
from truth.grade.answer import read_answer
from truth.machine.rig import Occasion, accelerance

TOLERANCE = Tolerances()
PROTOCOL = Protocol((1,), averages=10, lines=201, resolution_hz=1.0)
FREQ_HZ = np.linspace(5.0, 200.0, 40)


@pytest.fixture(scope="module")
def machine(two_bodies):
    return TrueMachine(two_bodies, draw_hammers(two_bodies, 1, TOLERANCE, 3))


@pytest.fixture(scope="module")
def refit(machine):
    return refit_of(machine, PROTOCOL, takes(PROTOCOL, machine.station, 1), TOLERANCE)


def frf(machine, *effects):
    return accelerance(replace(machine, effects=effects).rig(Occasion()), FREQ_HZ)


def test_a_delay_of_a_channel_turns_its_phase_alone(machine):
    node = next(sensor.node for _, sensor in machine.station.sensors())
    late = frf(machine, ChannelDelays(size=2e-5, node=node, shares=(0.0, 0.5, 1.0)))
    ratio = late[:, :3] / frf(machine)[:, :3]
    for row, delay in enumerate((0.0, 1e-5, 2e-5)):
        expected = np.exp(-2j * np.pi * FREQ_HZ * delay)[:, None]
        np.testing.assert_allclose(ratio[:, row], np.broadcast_to(expected, ratio[:, row].shape))
    np.testing.assert_allclose(late[:, 3:], frf(machine)[:, 3:])


def test_a_turned_guide_has_the_stiffness_of_a_turned_spring(machine):
    """K changes by k (g' g'^T - g g^T) for slides, whose axes are turned by hand here."""
    stage = machine.station.stages[0]
    turns = tuple((0.0, 0.0, 1.0) if j.kind == "slide" else (0.0, 0.0, 0.0) for j in stage.joints)
    askew = AskewGuides(size=0.2, stage=stage.name, turns=turns)
    rig = replace(machine, effects=(askew,)).rig(Occasion())
    before = machine.rig(Occasion()).equations.stiffness
    axes = np.array([j.axis for j in stage.joints if j.kind == "slide"])
    turned = axes + 0.2 * np.cross([0.0, 0.0, 1.0], axes)
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    k = np.array([j.stiffness for j in stage.joints if j.kind == "slide"])
    # q = S^+ u: with three slides along turned axes the force is S^-T k S^-1 u.
    expected = np.linalg.inv(turned).T  # columns of S^-T
    after = expected.T @ np.diag(k) @ expected
    change = rig.equations.stiffness[:3, :3] - before[:3, :3]
    np.testing.assert_allclose(change, after - np.diag(k), atol=1e-6 * k.max())


def test_every_item_vanishes_with_its_size(machine):
    background = draw_background(machine.station, 200.0, 7)
    base, whole = frf(machine), frf(machine, *background.effects)
    small = frf(machine, *background.rescale(1e-3).effects)
    assert np.abs(whole - base).max() > 1e-3 * np.abs(base).max()
    assert np.abs(small - base).max() < 0.02 * np.abs(whole - base).max()


@pytest.mark.parametrize("wanted", [0.05, 0.15])
def test_a_background_leaves_the_wanted_part_of_the_motion(machine, refit, wanted):
    drawn = draw_background(machine.station, 200.0, 7)
    sized = size_background(drawn, refit, wanted)
    left = refit.motion_left(replace(machine, effects=sized.effects), wanted)
    assert mean_error(left, refit) == pytest.approx(wanted, rel=0.08)
    assert sized.left == pytest.approx(left)


def test_a_machine_that_nothing_can_change_is_refused(refit):
    with pytest.raises(TruthError, match="changes no channel"):
        size_background(Background(), refit, 0.1)


def test_a_test_of_dead_and_noisy_channels_cannot_size_a_background(machine, refit):
    deaf = replace(refit, used=np.zeros_like(refit.used))
    with pytest.raises(TruthError, match="no channel that is alive"):
        size_background(draw_background(machine.station, 200.0, 7), deaf, 0.1)


def test_the_ratio_beside_a_background_is_over_noise_and_background(machine, refit):
    """With e0 of the background and e1 with the effect too: ratio = sqrt(e1^2 - e0^2) / e0."""
    sized = size_background(draw_background(machine.station, 200.0, 7), refit, 0.15)
    beside = refit_of(machine, PROTOCOL, takes(PROTOCOL, machine.station, 1), TOLERANCE, sized.left)
    power = (sized.left**2 / refit.noise_share**2)[refit.used].mean()
    assert beside.without.excess == pytest.approx(np.sqrt(1 + power))
    assert beside.without.excess > 1.5
    change = 1e-3 * refit.deviation
    assert beside._residual_ratio(change) == pytest.approx(
        refit._residual_ratio(change) / beside.without.excess
    )


def test_a_campaign_with_dirt_tells_it_in_its_answer_alone(two_bodies, tmp_path):
    plan = Plan(3, Cause((Wanted("appendage", None, 2.0),)), PROTOCOL)
    clean, dirty = (
        draw_campaign(two_bodies, plan),
        draw_campaign(two_bodies, replace(plan, dirt=15)),
    )
    assert clean.files["model.xml"] == dirty.files["model.xml"]
    assert clean.files["campaign.toml"] == dirty.files["campaign.toml"]
    (tmp_path / "answer.toml").write_bytes(dirty.answer)
    told = tomllib.loads(dirty.answer.decode())["dirt"]
    assert told["per_cent"] == 15.0
    truth = read_answer(tmp_path / "answer.toml")
    assert truth.effect == "appendage"
    assert ("structural_damping", f"joint:{two_bodies.stages[0].name}") in truth.background
    assert b"[dirt]" not in clean.answer


def test_dirt_beside_a_nonlinear_joint_has_no_loss_factors(two_bodies, tmp_path):
    plan = Plan(3, Cause((Wanted("friction"),)), PROTOCOL, dirt=5)
    (tmp_path / "answer.toml").write_bytes(draw_campaign(two_bodies, plan).answer)
    effects = {effect for effect, _ in read_answer(tmp_path / "answer.toml").background}
    assert "appendage" in effects
    assert "structural_damping" not in effects


def test_an_absurd_dirt_is_refused():
    with pytest.raises(TruthError, match="per cent"):
        Plan(1, dirt=150.0)


def test_supports_that_are_lost_can_stand_on_askew_guides(nominal):
    plan = Plan(3, Cause((Wanted("support_loss", "joint:granite_bottom"),)), dirt=5)
    assert b"support_loss" in draw_campaign(nominal, plan).answer
