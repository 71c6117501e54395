"""Remarks of a simulation: stops of a range that are reached, gaps that stay open, lost springs."""

import mujoco
import numpy as np
import pytest
from mbmodel_examples import mjcf

from identification.words import ConvergenceError
from mbmodel import load_machine, simulate
from mbmodel.nonlinear_joints.files import write_nonlinear_joints
from mbmodel.nonlinear_joints.laws import GapSpring, PolynomialSpring
from mbmodel.simulation.drives import JointDof
from mbmodel.simulation.joint_reach import limit_stiffness

TIME_S = np.arange(0, 0.1, 1e-3)
FORCE = np.where(TIME_S < 0.02, np.sin(np.pi * TIME_S / 0.02) ** 2, 0.0)
BODY = """
<body name="stage"><inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
  <joint name="slide" type="slide" axis="1 0 0" stiffness="1e6" damping="85" {}/>
  <site name="acc1"/></body>
"""
RANGE = 'range="-5e-5 5e-5" limited="true"'


@pytest.fixture
def machine(tmp_path):
    def build(attributes="", law=None):
        path = tmp_path / "stage.xml"
        path.write_text(mjcf(BODY.format(attributes)), encoding="utf-8")
        if law is None:
            return load_machine(path)
        write_nonlinear_joints(path, tmp_path / "nonlinear.xml", [law])
        return load_machine(tmp_path / "nonlinear.xml")

    return build


def pushed(machine, peak):
    joint = (JointDof("slide"),)
    return simulate(machine, joint, joint, TIME_S, peak * FORCE[:, None])


def test_a_stop_of_a_range_is_remarked_where_the_motion_reaches_it(machine):
    limited = machine(RANGE)
    assert pushed(limited, 20.0).remarks == ()
    (remark,) = pushed(limited, 100.0).remarks
    assert "'slide' reaches the end of its range (-5e-05 to 5e-05 m)" in remark
    assert "2.24e+05 N/m" in remark
    assert pushed(machine(), 100.0).remarks == ()


@pytest.mark.parametrize(
    "solver",
    [
        "",
        'solreflimit="0.005 0.7" solimplimit="0.95 0.99 0.001"',
        'solreflimit="-1e6 -100" solimplimit="0.9 0.9 0.001"',
    ],
)
def test_the_stated_stiffness_of_a_stop_is_that_of_mujoco(solver):
    text = mjcf(BODY.format(f"{RANGE} {solver}").replace("1e6", "0", 1))
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.timestep = 1e-4
    data = mujoco.MjData(model)
    data.qpos[0], data.qfrc_applied[0] = 5e-5, 1.0
    for _ in range(20000):
        mujoco.mj_step(model, data)
    assert 1.0 / (data.qpos[0] - 5e-5) == pytest.approx(limit_stiffness(model, 0), rel=0.02)


def test_a_gap_that_stays_open_is_remarked(machine):
    (remark,) = pushed(machine(law=GapSpring("slide", 1e6, 1.0)), 100.0).remarks
    assert "never reaches a stop of its gap" in remark
    assert pushed(machine(law=GapSpring("slide", 1e6, 1e-6)), 100.0).remarks == ()


def test_a_softening_spring_is_named_where_it_gives_way(machine):
    softening = machine(law=PolynomialSpring("slide", 1e6, 0.0, -1e14))
    # The stiffness ends at sqrt(k / 3 |k3|) = 57.7 um, the force at 100 um.
    assert pushed(softening, 20.0).remarks == ()
    (remark,) = pushed(softening, 35.0).remarks
    assert "its stiffness is negative beyond 5.77e-05 m" in remark
    with pytest.raises(ConvergenceError, match=r"'slide' has a polynomial spring .* 0.0001 m"):
        pushed(softening, 2000.0)
    one_sided = machine(law=PolynomialSpring("slide", 1e6, 1e10, 0.0))
    with pytest.raises(ConvergenceError, match=r"beyond -0.0001 m"):
        pushed(one_sided, -2000.0)
