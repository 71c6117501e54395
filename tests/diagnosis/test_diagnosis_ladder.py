"""The search for what explains a gap: what is far from the drawing is sought from elsewhere too."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import Scene, diagnose, verdict_of
from diagnosis.effects import feedback_delay, missing_dof, viscoelastic
from diagnosis.inference.evidence import Pushed
from diagnosis.refits.refitting import posed
from diagnosis.search.ladder import Hunt, _elsewhere, nearly
from diagnosis.search.score_test import Score, lines_over, ranked
from diagnosis.search.screening import Screening
from identification.words import Dof, UsageError
from mbmodel import (
    Evaluator,
    FrfRequest,
    RigidDirection,
    as_drawn,
    load_machine,
    release_rigid_directions,
)
from tests.helpers.drawn import drawn
from tests.helpers.small_machine import MJCF
from tuning import open_session


def test_two_of_four_supports_that_carry_next_to_nothing_are_found(tmp_path):
    # From no loss at all, and springs as a fit without any loss has left them, no fit comes there.
    session, text = drawn(tmp_path, 72_301, "support_loss", ratio=60.0, lines=161)
    answer = tomllib.loads(text)
    assert answer["parameters"]["fraction"] == pytest.approx([1.0, 1.0, 0.05, 0.05])
    verdict = verdict_of(diagnose(session))
    first = verdict.causes[0]
    assert (first.effect, first.location) == ("support_loss", answer["location"])
    assert first.parameters["fraction"] == pytest.approx([1.0, 1.0, 0.05, 0.05], abs=0.02)
    assert all(low <= 0.05 <= high for low, high in first.interval["fraction"][2:])
    # Without the logarithm on the way from afar a fit ends with an excess of 2.6.
    assert verdict.gap.after.excess < 1.2


def test_a_direction_that_gives_way_by_far_is_found_though_its_slope_shows_nothing(tmp_path):
    session, _ = drawn(tmp_path, 72_062, "gyroscopic", ratio=6.0)
    _, held = release_rigid_directions(session.model.machine, float(session.campaign.freq_hz.max()))
    assert held == ()  # all six directions have springs
    scene = Scene(session, session.model.drawn, ())
    rows = [Score(one, 0.0, np.zeros(1)) for one in _ways(session)]
    ((found,),) = _elsewhere([rows], {("joint:stage2", "ry")}, scene)
    drawn_too = {name: found.begin[name] for name in found.begin.keys() - found.otherwise[0]}
    assert found.begin == {**drawn_too, **found.otherwise[0]}
    names = [parameter.name for parameter in session.model.parameters]
    assert drawn_too.keys() == set(session.parametrisation.names) & set(names)
    for name, value in drawn_too.items():
        assert value == session.model.drawn[names.index(name)]
    assert _elsewhere([rows], {("joint:stage2", "rx")}, scene) == []
    sure = [replace(row, gain=5.0) for row in rows]
    assert _elsewhere([sure], {("joint:stage2", "ry")}, scene) == []
    # An allowance sees a little, and the weights of the noise nothing.
    for rounds in ([sure, rows], [rows, sure]):
        ((again,),) = _elsewhere(rounds, {("joint:stage2", "ry")}, scene)
        assert again.begin == found.begin
    # Beside another effect the fit has not wandered: each begins from there first.
    ((near, far),) = _elsewhere([rows], {("joint:stage2", "ry")}, replace(scene, there={"x"}))
    assert near.begin == found.otherwise[0]
    assert far.begin == found.begin
    (spring,) = (name for name in drawn_too if name.endswith("stage1_ry.stiffness"))
    ((_, far),) = _elsewhere([rows], {("joint:stage2", "ry")}, replace(scene, there={spring}))
    assert far.begin.keys() == found.begin.keys() - {spring}


def test_a_branch_as_stiff_as_the_joint_is_sought_from_there_too(tmp_path):
    # Begun from next to nothing, one on a station's tilt ended there, a loss factor in its place.
    session, _ = drawn(tmp_path, 72_062, "gyroscopic", ratio=6.0)
    scene = Scene(session, session.model.drawn, ())
    rows = [Score(one, 1.0, np.zeros(1)) for one in viscoelastic.propose(scene)]
    ((found,),) = _elsewhere([rows], {("joint:stage2", "ry")}, scene)
    assert found.location == "joint:stage2"
    begun = {name: value for name, value in found.begin.items() if name in found.otherwise[0]}
    assert list(begun.values()) == [1.0]
    assert found.state(begun | {name.replace("size", "time"): 0.0 for name in begun})["ratio"] == 1


def test_beginnings_are_tried_last_wherever_a_force_explains_nearly_as_much():
    # Of a granite that rocks on three supports a force explains as much at any stage on it.
    rows = [("body:a", "tz", 100.0), ("joint:a", "rx", 90.0), ("joint:b", "ty", 81.0)]
    pushed = [Pushed(location=place, dof=dof, gain=gain) for place, dof, gain in rows]
    far = Pushed(location="joint:c", dof="ty", gain=79.0)
    assert nearly([*pushed, far], [("body:a", "tz")]) == [("joint:a", "rx"), ("joint:b", "ty")]
    assert nearly([far.model_copy(update={"gain": 0.0})], []) == nearly([], []) == []


def _ways(session):
    """The hypothesis of a direction that is held."""
    machine = session.model.machine
    held = (RigidDirection("stage2", "ry", len(machine.coordinates) - 1, 1e8, 9e12, 1e-4),)
    (one,) = missing_dof.propose(Scene(session, session.model.drawn, held))
    name = one.coordinates[0]
    (begun,) = one.otherwise
    stated = one.state(begun | {name.replace("compliance", "time_constant"): 0})
    springs = [s.stiffness for s in machine.springs if s.location == "joint:stage2" and s.angular]
    assert stated["stiffness"] == pytest.approx(np.median(springs))
    return [one]


def test_of_delays_that_score_alike_the_shortest_comes_first(tmp_path):
    # Begun at six times its delay a refit ended far from it, at its own it arrived.
    session, _ = drawn(tmp_path, 72_062, "gyroscopic", ratio=6.0)
    scene = Scene(session, session.model.drawn, ())
    proposed = list(feedback_delay.propose(scene))
    first = next(one for one in proposed if one.dof == "ry")
    delays = [one for one in proposed if one.key == first.key][:3]
    other = next(one for one in proposed if one.key != first.key)
    names = [p.name for p in session.model.parameters]
    for gains, order in (((97.5, 98.0, 100.0), (0, 1, 2)), ((80.0, 98.0, 100.0), (1, 2, 0))):
        gained = [(gain, np.zeros(1)) for gain in (*gains, 99.0)]
        rows = [row.hypothesis for row in ranked([*delays, other], gained)]
        near = [delays[k] for k in order if gains[k] > 97.0]
        assert rows == [*near, other, *(one for one in delays if one not in near)]
    # The damper beside it varies by itself: so the valley is straight along which both vary.
    varies = posed(scene, first, session.campaign).parametrisation
    (damping,) = first.linear
    assert not varies.is_logarithmic[varies.names.index(damping)]
    assert session.parametrisation.is_logarithmic[session.parametrisation.names.index(damping)]
    assert first.begin[damping] > session.model.drawn[names.index(damping)]


HEAVIER = MJCF.replace('mass="35" diaginertia="1 1.2 0.9"', 'mass="45" diaginertia="1.1 1.4 1.0"')
CAMPAIGN = """\
model = "model.xml"
[[test]]
file = "t.npz"
averages = 10
channels = "nodes 1..6, xyz"
references = ["3:+x", "3:+y", "3:+z"]
quantity = "accelerance"
[tuning]
fix = ["*.stiffness", "*.damping"]
"""


def heavier(folder):
    """A machine whose head weighs ten kilograms more than drawn, its springs known."""
    for name, text in (("true.xml", HEAVIER), ("model.xml", MJCF), ("campaign.toml", CAMPAIGN)):
        (folder / name).write_text(text, encoding="utf-8")
    model, freq = as_drawn(load_machine(folder / "true.xml")), np.linspace(5, 165, 321)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 7) for axis in range(3))
    inputs = tuple(Dof.of("acc3", axis) for axis in range(3))
    values = Evaluator(model, FrfRequest(freq, outputs, inputs)).at(model.drawn).values
    size = np.sqrt((np.abs(values) ** 2).mean(axis=0))
    sigma = 0.01 * np.maximum(size, 0.1 * size.max())
    error = np.random.default_rng(1).normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
    noisy = values + error[0] + 1j * error[1]
    coherence = 1 / (1 + 9 * sigma**2 / np.abs(noisy) ** 2)  # of ten averages
    frf, coherence = (np.moveaxis(one, 0, 2) for one in (noisy, coherence))
    np.savez(folder / "t.npz", frf=frf, coherence=coherence, freq_hz=freq)
    return folder


def test_who_takes_most_of_a_very_large_gap_ends_no_search(tmp_path):
    # An appendage scores best, and leaves 2.9 times the noise's power of a gap of 4500 times.
    found = diagnose(open_session(heavier(tmp_path)))
    assert found.nothing.chi_square > 1000
    assert "appendage" in {one.effect for one in found.evidence.refits}
    verdict = verdict_of(found)
    first = verdict.causes[0]
    assert (first.effect, first.location) == ("mass_error", "body:head")
    assert first.parameters["mass"] == pytest.approx(10.0, rel=0.01)
    assert first.probability > 0.95
    # No hit turns the head about x: unbelieved, its moment of inertia there ran to where the mass
    # matrix has a negative eigenvalue.
    refit = next(one for one in found.search.refits if one.key[0] == "mass_error")
    mass = refit.session.model.matrices(refit.fit.theta).mass
    assert np.linalg.eigvalsh(mass)[0] > 0.5


def test_what_explains_all_is_tried_at_other_places_too(tmp_path, monkeypatch):
    # As if masses on another body had scored best and left next to nothing.
    best = Screening.best

    def without_head(screen, pushing=()):
        return [one for one in best(screen, pushing) if one.location == "body:base"]

    monkeypatch.setattr(Screening, "best", without_head)
    monkeypatch.setattr(Hunt, "_leaves_less", lambda *_: True)
    monkeypatch.setattr(Hunt, "_try_rivals", lambda *_: None)
    found = diagnose(open_session(heavier(tmp_path)))
    assert found.search.refits[0].key[:2] == ("mass_error", "body:head")
    assert {one.key[1] for one in found.search.begun if one.key} == {"body:base", "body:head"}


def test_who_scores_near_what_the_best_gains_is_tried_though_first_steps_forgot_it(
    tmp_path, monkeypatch
):
    promising = Screening.best

    def others(self, pushing=()):
        """Without the right one."""
        return [one for one in promising(self, pushing) if one.location != "body:head"]

    monkeypatch.setattr(Screening, "best", others)
    monkeypatch.setattr(Hunt, "_leaves_less", lambda *_: True)
    monkeypatch.setattr(Hunt, "_try_other_places", lambda *_: None)
    session = open_session(heavier(tmp_path))
    found = diagnose(session).search
    assert found.refits[0].key[1] == "body:head"
    monkeypatch.setattr(Hunt, "_try_rivals", lambda *_: None)
    without = diagnose(session).search
    assert "body:head" not in {one.key[1] for one in without.refits}
    assert found.refits[0].cost < 0.1 * without.refits[0].cost


def test_scores_count_fewer_lines_than_fits():
    assert lines_over(801, 1) == pytest.approx(200 / 67, rel=0.01)
    assert lines_over(801, 3) == pytest.approx(67 / 32, rel=0.1)  # no fewer than 32
    assert lines_over(100, 1) == 1


def test_of_few_lines_nothing_is_diagnosed(tmp_path):
    with pytest.raises(UsageError, match="needs 8 lines or more, and the band holds 2"):
        diagnose(open_session(heavier(tmp_path), (20.0, 20.9)))


def test_where_no_force_explains_a_gap_the_best_scores_are_tried_before_it_ends():
    def seen(gain, turn, forced=()):
        rounds = [(), [SimpleNamespace(gain=gain)] if gain else []]
        return SimpleNamespace(_forced=forced, _rounds=rounds, _turn=turn)

    assert Hunt._is_hopeless(seen(5.0, 0))
    assert Hunt._is_hopeless(seen(None, 0))
    assert not Hunt._is_hopeless(seen(80.0, 0))
    assert Hunt._is_hopeless(seen(80.0, 1))
    assert not Hunt._is_hopeless(seen(5.0, 1, [("joint:a", "tx")]))


def test_an_effect_too_weak_for_a_free_force_is_found_by_what_lines_share(tmp_path):
    # 3 % of the noise's power, less than its variance is known to: chi square is below one.
    session, text = drawn(tmp_path, 72_400, "structural_damping", ratio=0.1)
    found = diagnose(session)
    assert found.nothing.chi_square < 1 < 1 + found.nothing.gap
    assert not found.nothing.is_noise
    assert all(one.gain < 10 for one in found.evidence.pushed)
    best = found.search.refits[0]
    assert best.key[:2] == ("structural_damping", tomllib.loads(text)["location"])
    assert best.gap < 0.5 * found.nothing.gap


@pytest.mark.parametrize("seed", [72_502, 72_503, 72_505])
def test_of_few_channels_what_the_fit_follows_of_the_noise_is_no_gap(tmp_path, seed):
    # 90 FRFs of 240 lines: lines that the fit did not see shared 0.01 of the noise by its error.
    session, _ = drawn(tmp_path, seed, None, lines=241)
    found = diagnose(session)
    assert found.evidence.by == "lines"
    assert abs(found.nothing.serial) < 0.005
    assert found.nothing.scatter > 1.5
    assert found.judged.word == "none"
    assert found.judged.none > 0.9
