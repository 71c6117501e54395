"""Nonlinear joints in MJCF: written, read back, and their force law through MuJoCo."""

import numpy as np
import pytest
from joint_cycle import cycle_joint
from mbmodel_examples import mjcf

from identification.words import InputError, UsageError
from mbmodel import as_drawn, load_machine, model_modes, simulate
from mbmodel.nonlinear_joints.files import read_nonlinear_joints, write_nonlinear_joints
from mbmodel.nonlinear_joints.laws import (
    DryFriction,
    GapSpring,
    JenkinsElement,
    PolynomialSpring,
)
from mbmodel.simulation.drives import JointDof

MASS, STIFFNESS = 2.0, {"slide": 1e4, "turn": 2e3}
BODY = """
<body name="stage"><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
  <joint name="slide" type="slide" axis="1 0 0" stiffness="1e4" damping="10" springref="1e-5"/>
  <joint name="turn" type="hinge" axis="0 0 1" stiffness="2e3" damping="1"/>
  <site name="acc1" pos="0.1 0 0"/></body>
"""
# A large cycle, then small ones inside it: memory of friction shows.
TURNS = np.linspace(0, 2 * np.pi, 1001)
PLACES = 3e-4 * np.concatenate([np.sin(TURNS), 0.5 * np.sin(2 * TURNS)])

LAWS = [
    PolynomialSpring("slide", 1e4, 2e6, 5e10),
    PolynomialSpring("turn", 2e3, 0.0, -5e9),
    JenkinsElement("slide", 4e4, 3.0),
    JenkinsElement("turn", 500.0, 0.07),
    GapSpring("slide", 2e4, 1e-4),
    GapSpring("slide", 2e4, 1e-4, preload=1.5),
    GapSpring("turn", 2e3, 5e-5, preload=-0.1),
    DryFriction("slide", 2.0),
]
SPRINGS = [law for law in LAWS if not isinstance(law, DryFriction)]


@pytest.fixture
def drawing(tmp_path):
    path = tmp_path / "stage.xml"
    path.write_text(mjcf(BODY), encoding="utf-8")
    return path


def written(drawing, *laws):
    target = drawing.with_name("nonlinear.xml")
    write_nonlinear_joints(drawing, target, laws)
    return target


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_law_is_read_back_as_it_was_written(drawing, law):
    (read,) = read_nonlinear_joints(written(drawing, law))
    assert type(read) is type(law)
    assert read.joint == law.joint
    for name, value in vars(law).items():
        if name != "joint":
            assert getattr(read, name) == pytest.approx(value, rel=1e-12)


def test_several_joints_are_read_together(drawing):
    laws = (GapSpring("slide", 2e4, 1e-4), JenkinsElement("turn", 500.0, 0.07))
    kinds = {(type(law), law.joint) for law in read_nonlinear_joints(written(drawing, *laws))}
    assert kinds == {(GapSpring, "slide"), (JenkinsElement, "turn")}
    assert read_nonlinear_joints(drawing) == ()


def test_two_laws_of_one_spring_are_refused_in_either_order(drawing):
    spring, gap = PolynomialSpring("slide", 1e4, 0.0, 5e10), GapSpring("slide", 2e4, 1e-4)
    for laws in ((spring, gap), (gap, spring), (gap, gap)):
        with pytest.raises(UsageError, match="'slide' has two laws of its own spring"):
            written(drawing, *laws)
    with pytest.raises(UsageError, match="two laws of its dry friction"):
        written(drawing, DryFriction("slide", 2.0), DryFriction("slide", 3.0))
    beside = (spring, JenkinsElement("slide", 4e4, 3.0), DryFriction("slide", 2.0))
    read = {(type(law), law.joint) for law in read_nonlinear_joints(written(drawing, *beside))}
    assert read == {(type(law), law.joint) for law in beside}
    # Both forces act at once: friction of the tendon beside the cubic spring.
    force = cycle_joint(written(drawing, *beside[:2]), "slide", PLACES)
    wanted = spring.follow(PLACES) + beside[1].follow(PLACES)
    assert np.abs(force - wanted).max() < 2e-6 * np.abs(wanted).max()


@pytest.mark.parametrize("law", SPRINGS, ids=str)
def test_the_force_in_a_quasi_static_cycle_is_that_of_the_law(drawing, law):
    # The laws' own formulas, with a slider's memory: no line of MuJoCo's.
    force = cycle_joint(written(drawing, law), law.joint, PLACES)
    if isinstance(law, JenkinsElement):
        force = force - STIFFNESS[law.joint] * PLACES
    wanted = law.follow(PLACES)
    assert np.abs(force - wanted).max() < 2e-6 * np.abs(wanted).max()
    assert np.abs(wanted).max() > 0


def test_a_jenkins_cycle_loses_the_energy_of_its_parallelogram(drawing):
    # Amplitude A beyond the slip at u = limit / k: 4 limit (A - u) a cycle.
    law = JenkinsElement("slide", 4e4, 3.0)
    turns = np.linspace(0, 6 * np.pi, 6001)
    places = 3e-4 * np.sin(turns)
    force = cycle_joint(written(drawing, law), "slide", places)
    last = turns >= 4 * np.pi
    loss = np.trapezoid(force[last], places[last])
    assert loss == pytest.approx(4 * 3.0 * (3e-4 - 3.0 / 4e4), rel=1e-3)


def test_dry_friction_slides_at_its_limit_and_creeps_below_it(drawing):
    machine = load_machine(written(drawing, DryFriction("slide", 2.0)), without_friction=True)
    joint = (JointDof("slide"),)
    time_s = np.arange(0, 1.0, 1e-3)
    force = 6.0 * np.sin(2 * np.pi * time_s)
    place = simulate(machine, joint, joint, time_s, force[:, None]).outputs[:, 0]
    speed = np.gradient(place, time_s)
    friction = force - 1e4 * place - 10 * speed - MASS * np.gradient(speed, time_s)
    slides = np.abs(speed) > 5e-4
    assert slides.mean() > 0.3
    # A few samples lie between sticking and sliding.
    assert np.quantile(np.abs(friction[slides]), [0.05, 1.0]) == pytest.approx(2.0, rel=0.01)
    assert (np.sign(friction[slides]) == np.sign(speed[slides])).all()
    rising = 1.0 * np.clip(time_s / 0.1, 0, 1)
    place = simulate(machine, joint, joint, time_s, rising[:, None]).outputs[:, 0]
    creep = (place[160] - place[140]) / (time_s[160] - time_s[140])
    assert 1.0 / creep == pytest.approx(1e8 * MASS, rel=0.01)


def test_small_motion_sees_the_sticking_spring_and_an_open_gap(drawing):
    def frequency(*laws):
        path = written(drawing, *laws) if laws else drawing
        model = as_drawn(load_machine(path))
        return np.sort(model_modes(model, model.drawn).freq_hz)[0]

    free = np.sqrt(1e4 / MASS) / (2 * np.pi)
    assert frequency() < 1.001 * free
    turn = np.sqrt(2e3) / (2 * np.pi)
    assert frequency(JenkinsElement("slide", 4e4, 3.0)) == pytest.approx(turn, rel=1e-4)
    stuck = np.sort(model_frequencies(written(drawing, JenkinsElement("slide", 4e4, 3.0))))
    assert stuck[-1] == pytest.approx(np.sqrt(5e4 / MASS) / (2 * np.pi), rel=1e-4)
    assert model_frequencies(written(drawing, GapSpring("slide", 2e4, 1e-4))).min() < 1e-3
    closed = model_frequencies(written(drawing, GapSpring("slide", 2e4, 1e-4, preload=1.5)))
    assert closed.max() == pytest.approx(np.sqrt(2e4 / MASS) / (2 * np.pi), rel=1e-4)


def model_frequencies(path):
    model = as_drawn(load_machine(path))
    return model_modes(model, model.drawn).freq_hz


def test_what_has_no_linear_model_or_no_meaning_is_refused(drawing):
    with pytest.raises(InputError, match="frictionloss"):
        load_machine(written(drawing, DryFriction("slide", 2.0)))
    with pytest.raises(InputError, match="no slide or hinge 'nothing'"):
        written(drawing, DryFriction("nothing", 2.0))
    for wrong in ({"k": 0.0, "limit": 1.0}, {"k": 1.0, "limit": -1.0}, {"k": np.nan, "limit": 1.0}):
        with pytest.raises(UsageError):
            JenkinsElement("slide", **wrong)


def test_a_remark_says_what_the_linear_model_keeps(drawing):
    assert load_machine(drawing).remarks == ()
    (stuck,) = load_machine(written(drawing, JenkinsElement("slide", 4e4, 3.0))).remarks
    assert "'slide' has friction that sticks as a spring (k = 4e+04, limit = 3)" in stuck
    path = written(drawing, DryFriction("slide", 2.0))
    (dry,) = load_machine(path, without_friction=True).remarks
    assert "leaves it out" in dry


@pytest.mark.parametrize("gap", [1e-8, 1e-7, 3e-6])
def test_a_narrow_gap_is_linearised_inside_it(drawing, gap):
    # A difference of 1e-6 m would reach the stops of a stage's usual play.
    drawing.write_text(mjcf(BODY.replace('springref="1e-5"', "")), encoding="utf-8")
    assert model_frequencies(written(drawing, GapSpring("slide", 2e4, gap))).min() < 1e-3


def test_a_steep_cubic_spring_has_the_slope_of_its_linear_term(drawing):
    # k3 x^2 = k at 1e-6 m: a difference over that way would double the stiffness.
    steep = model_frequencies(written(drawing, PolynomialSpring("slide", 1e4, 0.0, 1e16)))
    assert steep == pytest.approx(model_frequencies(drawing), rel=1e-6)
