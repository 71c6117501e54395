"""A place on a body is in its box, and what no motion shows is neither fitted nor stated."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.effects.body_box import find_box
from diagnosis.effects.scales import GAIN_ENDS
from diagnosis.refits.refitting import add_hypotheses
from diagnosis.search.score_test import scores
from mbmodel import Model, load_machine, release_rigid_directions, transport
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, propose_at, refit_null

BOX = '<geom type="box" size="0.2 0.1 0.05" pos="0.1 0 0" mass="0"/>'
MESH = '<geom type="mesh" mesh="wedge" mass="0"/>'
WEDGE = "0 0 0  0.6 0 0  0 0.3 0  0 0 0.2"
FLOORS = """<mujoco><option gravity="0 0 0"/><compiler angle="radian"/>
<asset><mesh name="wedge" vertex="{wedge}"/></asset><worldbody>
<body name="low" pos="0 0 0.2"><joint name="leg1" type="slide" axis="1 0 0" stiffness="5e4"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.01 0.01 0.01"/>{geom}
<site name="acc1" pos="0.15 0 0"/>
<body name="middle" pos="0 0 0.2"><joint name="leg2" type="slide" axis="1 0 0" stiffness="5e4"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.01 0.01 0.01"/>{geom}
<site name="acc2" pos="0.15 0 0"/>
<body name="top" pos="0 0 0.2"><joint name="leg3" type="{kind}" pos="0 0 -0.4" axis="{axis}"
stiffness="5e4"/><inertial pos="0 0 0" mass="5" diaginertia="0.01 0.01 0.01"/>
<site name="acc3" pos="0.15 0 0"/></body></body></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def virtual(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("drawn"), 72_001, lines=61)
    return Scene(session, session.model.drawn)


def load(folder, geom=BOX, kind="slide", axis="1 0 0"):
    path = folder / "floors.xml"
    path.write_text(FLOORS.format(geom=geom, kind=kind, axis=axis, wedge=WEDGE), encoding="utf-8")
    return load_machine(path)


def see(virtual, machine):
    """A scene with another machine, whose rigid directions are on stiff springs."""
    extended, rigid = release_rigid_directions(machine, 100.0)
    model = Model(extended, ())
    session = replace(virtual.session, model=model)
    return Scene(session, model.drawn, rigid)


REACH = np.sqrt(3 * 0.005 / 5)  # of a mass of 5 kg whose second moments are 0.005 kg m^2


@pytest.mark.parametrize(
    ("geom", "low", "high"),
    [
        (BOX, (-0.1, -0.1, -0.05), (0.3, 0.1, 0.05)),
        (MESH, (0.0, 0.0, 0.0), (0.6, 0.3, 0.2)),
        ("", (0.0, 0.0, 0.0), (0.15, 0.0, 0.0)),
    ],
)
def test_the_box_is_that_of_geoms_points_and_mass_with_half_its_largest_edge_around(
    tmp_path, geom, low, high
):
    machine = load(tmp_path, geom)
    box = find_box(machine, [0]) - machine.layout.centres[0]
    low, high = np.minimum(low, -REACH), np.maximum(high, REACH)
    high[0] = max(high[0], 0.15)  # the sensor
    margin = 0.5 * (high - low).max()
    np.testing.assert_allclose(box, [low - margin, high + margin], atol=1e-9)


def test_the_joint_of_a_body_without_geoms_is_on_it(tmp_path):
    machine = load(tmp_path, kind="hinge", axis="0 1 0")
    low, _ = find_box(machine, [2]) - machine.layout.centres[2]
    edge = 0.4 + REACH
    assert low[2] == pytest.approx(-0.4 - edge / 2)


def test_every_place_that_a_fit_may_reach_is_in_the_box(virtual):
    machine = virtual.model.machine
    random = np.random.default_rng(3)
    for effect in ("appendage", "parallel_path", "hammer_position"):
        for hypothesis in EFFECTS[effect](virtual):
            varies = add_hypotheses(virtual.session, hypothesis).parametrisation
            ends = np.maximum(varies.lower, -1e3), np.minimum(varies.upper, 1e3)
            names = [parameter.name for parameter in varies.parameters]
            for _ in range(3):
                x = np.where(random.uniform(size=varies.size) < 0.5, *ends)
                said = hypothesis.state(dict(zip(names, varies.theta(x).tolist(), strict=True)))
                name, bodies = hypothesis.location.partition(":")[::2]
                place = np.array(said.get("position", said.get("offset")), float)
                if name == "pair":
                    on = [b for b in hypothesis.movable.bodies if b != "world"]
                elif name == "hammer":
                    at = machine.layout.points.index(bodies)
                    on = [machine.layout.bodies[machine.layout.body_of[at]]]
                    place = place + machine.layout.positions[at]
                else:
                    on = [bodies]
                    place = place + machine.layout.centres[machine.layout.bodies.index(bodies)]
                low, high = find_box(machine, [machine.layout.bodies.index(b) for b in on])
                known = ~np.isnan(place)
                assert (low - 1e-9 <= place)[known].all(), hypothesis.words
                assert (place <= high + 1e-9)[known].all(), hypothesis.words


def test_along_slides_a_mass_and_a_link_have_no_place_and_no_stiffness_across(virtual, tmp_path):
    scene = see(virtual, load(tmp_path))
    for hypothesis in EFFECTS["mass_error"](scene):
        (name,) = hypothesis.coordinates
        said = hypothesis.state({p.name: 20.0 for p in hypothesis.parts[0].parameters})
        mass = -1.0 if ".missing" in name else 1.0
        assert said == {"mass": pytest.approx(mass), "position": (None, None, None)}
    for hypothesis in EFFECTS["appendage"](scene):
        assert len(hypothesis.coordinates) == 1
        said = hypothesis.state(
            dict.fromkeys((p.name for p in hypothesis.parts[0].parameters), 0.0)
        )
        assert tuple(said["position"]) == (None, None, None)
    link = next(iter(EFFECTS["parallel_path"](scene)))
    assert len(link.coordinates) == 2
    names = [p.name for p in link.parts[0].parameters]
    (slope,) = link.parts[0].derivatives(np.zeros(12))
    unit = slope.core[0, 0, 0, 0]
    said = link.state(dict(zip(names, [4e3 / unit, 9e9, *[0.0] * 10], strict=True)))
    assert said["stiffness"] == (pytest.approx(4e3), None, None)
    assert said["position"] == (None, None, None)


def test_what_turns_shows_the_place_across_its_axis(virtual, tmp_path):
    scene = see(virtual, load(tmp_path, kind="hinge", axis="0 1 0"))
    top = list(EFFECTS["mass_error"](scene))[-1]
    said = top.state(dict.fromkeys((p.name for p in top.parts[0].parameters), 20.0))["position"]
    # It swings below its centre of mass, so that the moment of x meets no motion along z.
    assert [value is None for value in said] == [True, True, False]
    link = next(
        hypothesis
        for hypothesis in EFFECTS["parallel_path"](scene)
        if hypothesis.location == "pair:low-top"
    )
    said = link.state({p.name: 1.0 for p in link.parts[0].parameters})
    assert [value is None for value in said["stiffness"]] == [False, True, False]
    assert [value is None for value in said["position"]] == [False, True, False]


def test_springs_turned_towards_the_axis_that_moves_are_stated_along_it(virtual, tmp_path):
    scene = see(virtual, load(tmp_path))
    link = next(iter(EFFECTS["parallel_path"](scene)))
    names = [p.name for p in link.parts[0].parameters]
    turned = dict(zip(names, [1.0, 1.0, 1.0, *[0.0] * 3, 0.5, 0.0, 0.0, *[0.0] * 3], strict=True))
    straight = turned | {names[6]: 0.0}
    ratio = link.state(turned)["stiffness"][0] / link.state(straight)["stiffness"][0]
    assert ratio == pytest.approx(1.25)  # k_x + n_xy^2 k_y


def test_what_nothing_shows_does_not_vary_in_a_fit(virtual, tmp_path):
    scene = see(virtual, load(tmp_path))
    hypothesis = next(iter(EFFECTS["mass_error"](scene)))
    moved = replace(hypothesis, begin=dict.fromkeys(hypothesis.held, 3.0))
    varies = add_hypotheses(virtual.session, replace(moved, parts=hypothesis.parts)).parametrisation
    names = [parameter.name for parameter in varies.parameters]
    theta = dict(zip(names, varies.theta(np.ones(varies.size)), strict=True))
    assert not {*hypothesis.held} & {*varies.names}
    assert all(theta[name] == 0.0 for name in hypothesis.held)


def test_gains_and_offsets_are_bounded_in_their_own_units(virtual):
    for effect in ("sensor_gain", "sensor_position"):
        hypothesis = next(iter(EFFECTS[effect](virtual)))
        varies = add_hypotheses(virtual.session, hypothesis).parametrisation
        names, name = [parameter.name for parameter in varies.parameters], hypothesis.release[0]
        low, high = (varies.theta(x)[names.index(name)] for x in (varies.lower, varies.upper))
        assert (low, high) == pytest.approx(hypothesis.bounds[name])
        if effect != "sensor_position":
            assert (low, high) == pytest.approx(GAIN_ENDS)


def test_a_mass_is_in_a_tetrahedron_that_holds_all_that_is_drawn_of_its_body(virtual):
    machine = virtual.model.machine
    for hypothesis in EFFECTS["mass_error"](virtual):
        (part,) = hypothesis.parts
        names = [p.name for p in part.parameters]
        number = machine.layout.bodies.index(hypothesis.movable.bodies[0])
        centre = machine.layout.centres[number]
        box = find_box(machine, [number])
        sign = 1.0 if ".added" in names[0] else -1.0
        for point in machine.layout.positions[machine.layout.body_of == number]:
            arm = point - centre
            turned = np.cross(np.eye(3), arm)
            aim = sign * np.block([[np.eye(3), -turned], [turned, -turned @ turned]])
            to_centre = transport(centre)
            values = hypothesis.movable.start({"inertia": to_centre.T @ aim @ to_centre})
            assert min(values[name] for name in names[:4]) >= -1e-9
            said = hypothesis.state({name: 1e3 * value for name, value in values.items()})
            assert said["mass"] == pytest.approx(1e3 * sign)
            np.testing.assert_allclose(said["position"], arm, atol=1e-9)
        for name in names[:4]:
            said = hypothesis.state(dict.fromkeys(names, 0.0) | {name: 5.0})["position"]
            reach = np.abs(centre + said - box.mean(axis=0))
            np.testing.assert_allclose(reach, 0.75 * np.ptp(box, axis=0))


def test_the_sign_of_a_mass_is_found_by_its_score(tmp_path):
    session, text = drawn(tmp_path, 72_301, "mass_error", lines=61)
    scene = early_scene(session)
    null = refit_null(scene)
    place = tomllib.loads(text)["location"]
    added, missing = propose_at(scene, "mass_error", place)
    scene = replace(scene, theta=null.fit.theta)
    best, other = scores(scene, null.fit, [missing, added], null.floor, 4)
    assert best.hypothesis is added
    assert best.gain > other.gain
    weights = [name for name in added.coordinates if "_mass_" in name]
    assert (best.step[: len(weights)] >= 0).all()
