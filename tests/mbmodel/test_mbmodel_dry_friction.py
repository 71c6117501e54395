"""Dry friction in time: against an integration by scipy that finds each reversal as an event."""

import numpy as np
import pytest
from mbmodel_examples import mjcf
from scipy.integrate import solve_ivp

from mbmodel import load_machine, simulate
from mbmodel.nonlinear_joints.files import read_nonlinear_joints, write_nonlinear_joints
from mbmodel.nonlinear_joints.laws import DryFriction
from mbmodel.simulation.drives import JointDof

MASS, STIFFNESS, DAMPING, LIMIT = 10.0, 1e6, 20.0, 100.0
BODY = """
<body name="stage"><inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
  <joint name="slide" type="slide" axis="1 0 0" stiffness="1e6" damping="20"/>
  <site name="acc1"/></body>
"""
PULSE_S = 0.004
TIME_S = np.arange(0, 0.5, 1 / 2048)
OLD_SOLVER = 'solreffriction="0.002 1" solimpfriction="0.999 0.999 0.001"'
OTHER_SOLVER = 'solreffriction="0.002 1" solimpfriction="0.99 0.999 0.001"'


def pulse(time_s):
    return np.where(time_s < PULSE_S, 4000 * np.sin(np.pi * time_s / PULSE_S) ** 2, 0.0)


@pytest.fixture
def drawing(tmp_path):
    path = tmp_path / "stage.xml"
    path.write_text(mjcf(BODY), encoding="utf-8")
    return path


def with_friction(drawing, attributes="", extra=""):
    path = drawing.with_name("friction.xml")
    text = mjcf(BODY.replace('damping="20"', f'damping="20" frictionloss="100" {attributes}'))
    path.write_text(text.replace("<worldbody>", f"{extra}<worldbody>"), encoding="utf-8")
    return path


def stick_slip(time_s):
    """Return the places of the mass, slide by slide until it sticks for good; (n,)."""
    places, state, begin, direction = np.zeros(len(time_s)), [0.0, 0.0], 0.0, 1.0
    # At first the mass sticks until the pulse exceeds the limit.
    begin = PULSE_S / np.pi * np.arcsin(np.sqrt(LIMIT / 4000))

    def stops(time, state):
        return state[1] if time > begin + 1e-6 else direction

    stops.terminal = True
    for _ in range(200):

        def rates(time, state, direction=direction):
            friction = LIMIT * direction
            force = pulse(time) - DAMPING * state[1] - STIFFNESS * state[0] - friction
            return [state[1], force / MASS]

        inside = time_s[(time_s >= begin)]
        run = solve_ivp(
            rates, (begin, time_s[-1]), state, "DOP853", inside, events=stops, rtol=1e-10,
            atol=1e-14, max_step=1e-3,
        )  # fmt: skip
        first = len(time_s) - len(inside)
        places[first : first + run.y.shape[1]] = run.y[0]
        if not run.t_events[0].size:
            return places
        begin, state = float(run.t_events[0][0]), [float(run.y_events[0][0][0]), 0.0]
        free = pulse(begin) - STIFFNESS * state[0]
        if abs(free) <= LIMIT:
            places[time_s >= begin] = state[0]
            return places
        direction = float(np.sign(free))
    raise AssertionError("more than 200 reversals")


def simulated(path):
    machine = load_machine(path, without_friction=True)
    joint = (JointDof("slide"),)
    return machine, simulate(machine, joint, joint, TIME_S, pulse(TIME_S)[:, None])


def relative_error(response):
    reference = stick_slip(TIME_S)
    difference = response.outputs[:, 0] - reference
    return np.sqrt((difference**2).mean() / (reference**2).mean())


def test_the_reference_loses_two_limits_over_stiffness_in_each_half_cycle():
    places = stick_slip(np.arange(0, 0.5, 1e-5))
    speeds = np.diff(places)
    turns = np.flatnonzero(speeds[1:] * speeds[:-1] < 0) + 1
    peaks = np.abs(places[turns])
    decay = np.exp(-np.pi * DAMPING / (2 * np.sqrt(STIFFNESS * MASS)))
    lost = LIMIT / STIFFNESS
    # About its own centre, F / k off, each half cycle decays by viscous damping alone.
    assert peaks[1:5] + lost == pytest.approx((peaks[:4] - lost) * decay, rel=1e-4)


def test_dry_friction_follows_an_integration_with_events(drawing):
    path = drawing.with_name("law.xml")
    write_nonlinear_joints(drawing, path, [DryFriction("slide", LIMIT)])
    _, response = simulated(path)
    assert relative_error(response) < 7e-3
    assert response.step.error > 1e-3  # of first order in the step


@pytest.mark.parametrize(
    ("attributes", "extra"),
    [("", ""), (OLD_SOLVER, ""), ("", '<option><flag refsafe="disable"/></option>')],
)
def test_friction_of_a_file_is_as_exact(drawing, attributes, extra):
    # MuJoCo's defaults, files of earlier versions, and files that switch refsafe off.
    path = with_friction(drawing, attributes, extra)
    (law,) = read_nonlinear_joints(path)
    assert law == DryFriction("slide", LIMIT)
    machine, response = simulated(path)
    assert relative_error(response) < 7e-3
    (remark,) = machine.remarks
    assert "all of it, with a harder setting of MuJoCo's solver than the file's" in remark


def test_a_solver_setting_of_the_file_is_kept_and_its_lead_remarked(drawing):
    machine, response = simulated(with_friction(drawing, OTHER_SOLVER))
    assert 0.1 < relative_error(response) < 0.3
    (remark,) = machine.remarks
    # b = 2 / (0.999 * 0.002) = 1001 1/s; 10 kg * 1001 * 0.99 / 0.01 = 991e3 N s/m
    assert "45 deg at 159 Hz" in remark
    assert "9.91e+05 N s/m" in remark


def test_a_tendon_with_dry_friction_is_as_exact(drawing):
    path = drawing.with_name("tendon.xml")
    tendon = '<tendon><fixed name="t" frictionloss="100"><joint joint="slide" coef="1"/></fixed>'
    path.write_text(mjcf(BODY).replace("</mujoco>", f"{tendon}</tendon></mujoco>"), "utf-8")
    _, response = simulated(path)
    assert relative_error(response) < 7e-3


def test_a_stuck_mass_moves_by_the_creep_alone(drawing):
    path = drawing.with_name("law.xml")
    write_nonlinear_joints(drawing, path, [DryFriction("slide", 1e5)])
    _, response = simulated(path)
    # The damper of the creep is 1e8 1/s times the mass.
    impulse = 4000 * PULSE_S / 2
    assert response.outputs[-1, 0] == pytest.approx(impulse / (1e8 * MASS), rel=0.02)
    assert response.step.error < 3e-3
