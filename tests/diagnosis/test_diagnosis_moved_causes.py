"""Causes moved to neighbouring bodies: the same place in space, the same values."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import EFFECTS
from diagnosis.hypothesis import Scene
from diagnosis.refits.refitting import add_cause, run_refits
from diagnosis.scene_points import are_joined
from diagnosis.search.fitted_sets import Search, compute_cosine, find_interchangeable
from diagnosis.search.moved_causes import _are_neighbours, move_causes
from diagnosis.settings import SETTINGS
from mbmodel import load_machine, transport
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, propose_at, refit_null, refit_with

ASSETS = Path(__file__).parents[2] / "assets"
MOVABLE = ("parallel_path", "appendage", "mass_error", "gyroscopic")
OMEGA = 2 * np.pi * np.array([20.0, 90.0])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("machine"), 72_012, lines=61, stages=5)
    return Scene(session, session.model.drawn)


def felt_together(machine, hypothesis, begin, moved):
    """Return Z(omega) that is added where some bodies move as one, about the origin; (2, 12, 12).

    Args:
        machine: with its bodies.
        hypothesis: whose Part acts.
        begin: values of its parameters.
        moved: names of the bodies that move together, as do all others.
    """
    (part,) = hypothesis.parts
    theta = np.array([begin[parameter.name] for parameter in part.parameters])
    rows = []
    for body, centre in zip(machine.layout.bodies, machine.layout.centres, strict=True):
        both = np.zeros((6, 12))
        side = slice(0, 6) if body in moved else slice(6, 12)
        both[:, side] = transport(centre)
        rows.append(both)
    frame = np.vstack(rows)
    total = np.zeros((2, 12, 12), complex)
    for change in part.finite(theta):
        for line, s in enumerate(1j * OMEGA):
            core = sum(change.core[k] * s**k for k in range(3))
            shape = 1.0 if change.shape is None else change.shape(np.array([s]))[0]
            total[line] += shape * (frame.T @ change.left @ core @ change.right.T @ frame)
    return total


@pytest.mark.parametrize("effect", MOVABLE)
def test_a_moved_effect_is_felt_alike_where_both_bodies_move_as_one(scene, effect):
    machine, random = scene.model.machine, np.random.default_rng(5)
    hypotheses = list(EFFECTS[effect](scene))
    first = hypotheses[0]
    bodies = first.movable.bodies
    other = next(
        hypothesis
        for hypothesis in hypotheses
        if len({*hypothesis.movable.bodies} - {*bodies}) == 1
        and are_joined(machine, *({*hypothesis.movable.bodies} ^ {*bodies}))
    )
    names = [parameter.name for parameter in first.parts[0].parameters]
    values = dict(zip(names, random.uniform(0.05, 0.3, len(names)).tolist(), strict=True))
    same = first.movable.start(first.movable.read(values))
    assert same == pytest.approx(values)
    begin = other.movable.start(first.movable.read(values))
    together = {*other.movable.bodies} ^ {*bodies}
    before = felt_together(machine, first, values, together)
    after = felt_together(machine, other, begin, together)
    assert np.abs(before).max() > 0
    np.testing.assert_allclose(after, before, atol=1e-9 * np.abs(before).max())


@pytest.fixture(scope="module")
def linked(tmp_path_factory):
    """A machine that lacks a link: its scene, null model and link."""
    folder = tmp_path_factory.mktemp("linked")
    session, text = drawn(folder, 72_520, "parallel_path", ratio=6.0, lines=161, stages=4)
    location = text.partition('location = "')[2].partition('"')[0]
    scene = early_scene(session)
    return scene, refit_null(scene), propose_at(scene, "parallel_path", location)[0]


def test_a_link_at_the_wrong_one_of_two_joined_bodies_is_moved_to_the_right_one(linked):
    scene, null, right = linked
    location = right.location
    wrong = [
        link
        for link in EFFECTS["parallel_path"](scene)
        if len({*link.movable.bodies} & {*right.movable.bodies}) == 1
    ]
    assert wrong, "the machine has no other pair with a body of the link"
    best = refit_with(scene, null, wrong[0])
    scores = tuple(SimpleNamespace(hypothesis=link) for link in (right, wrong[0]))
    search, moved = move_causes(
        scene, Search(null, best, scores, (best,)), best, best.causes, SETTINGS
    )
    assert [key[1] for key in moved.keys] == [location]
    assert moved.objective < best.objective
    assert {refit.keys[-1][1] for refit in search.refits} >= {wrong[0].location, location}
    (cold,) = run_refits(scene, [add_cause(null, right)], SETTINGS.schedule)
    assert moved.objective < cold.objective + 1e-3  # as good as from no link, or better
    again, kept = move_causes(scene, search, moved, moved.causes, SETTINGS)
    assert kept.keys == moved.keys
    assert len(again.refits) > len(search.refits)


def test_what_two_refits_take_off_the_gap_has_a_cosine_in_sigmas():
    random = np.random.default_rng(3)
    shapes = [(5, 2, 1), (5, 3, 1)]

    def draw():
        return [random.normal(size=shape) + 1j * random.normal(size=shape) for shape in shapes]

    without, first, second = draw(), draw(), draw()
    weights = [random.uniform(0.5, 2, shape) for shape in shapes]
    by_hand = [
        np.concatenate(
            [(w * (r - e)).ravel() for w, r, e in zip(weights, without, end, strict=True)]
        )
        for end in (first, second)
    ]
    real = [np.concatenate([vector.real, vector.imag]) for vector in by_hand]
    expected = real[0] @ real[1] / np.sqrt((real[0] @ real[0]) * (real[1] @ real[1]))
    assert compute_cosine(without, first, second, weights) == pytest.approx(expected)
    assert compute_cosine(without, first, first, weights) == pytest.approx(1.0)
    weights[1][:] = 0.0  # channels that do not count
    second[1] = second[1] + 7.0
    counted = compute_cosine(without[:1], first[:1], second[:1], weights[:1])
    assert compute_cosine(without, first, second, weights) == pytest.approx(counted)


def test_a_link_to_either_of_two_bodies_that_move_as_one_is_interchangeable(linked):
    scene, null, right = linked
    location = right.location
    fits = [refit_with(scene, null, right)]
    far = [place for place in propose_places(scene) if place != location]
    fits += [refit_with(scene, null, propose_at(scene, "parallel_path", place)[0]) for place in far]
    search = Search(null, fits[0], refits=tuple(fits))
    names = {
        frozenset(place for _, place in pair) for pair in find_interchangeable(search, 1, SETTINGS)
    }
    gaps = {fit.causes[0].location: fit.gap for fit in fits}
    for pair in names:  # who takes the same off leaves as much
        first, second = (null.gap - gaps[place] for place in pair)
        assert first == pytest.approx(second, rel=0.25)
    weak = {
        place for place, gap in gaps.items() if null.gap - gap < 0.5 * (null.gap - gaps[location])
    }
    assert not any(location in pair and pair & weak for pair in names)


def propose_places(scene):
    """The places of a link."""
    return dict.fromkeys(link.location for link in EFFECTS["parallel_path"](scene))


def test_causes_of_sensors_are_not_moved(scene):
    null = refit_null(scene)
    fault = next(iter(EFFECTS["sensor_position"](scene)))
    best = refit_with(scene, null, fault)
    search = Search(null, best, refits=(best,))
    assert move_causes(scene, search, best, best.causes, SETTINGS) == (search, best)


def test_bodies_that_a_constraint_of_a_closed_chain_ties_are_neighbours():
    machine = load_machine(ASSETS / "hexapod.xml")
    assert _are_neighbours(machine, ("strut6",), ("platform",))
    assert not _are_neighbours(machine, ("leg6",), ("platform",))
    ties = {frozenset((f"strut{k}", "platform")) for k in range(1, 7)}
    assert machine.drawing.ties == ties
    file = ASSETS / "two_bodies.xml"
    assert not load_machine(file).drawing.ties
