"""Integral force feedback against its closed form, and Jacobians of struts against MuJoCo's."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.words import UsageError
from mbmodel import as_drawn, load_machine
from tuning.plant.damping.force_feedback import feedback_dynamics, force_feedback
from tuning.plant.damping.frames import find_struts, platform_of, strut_frames, strut_jacobian

LEGS = Path(__file__).resolve().parents[2] / "assets/microstation/station_legs.xml"
ONE = """
<mujoco><option gravity="0 0 0"/><worldbody>
  <site name="ground" pos="-0.5 0 0"/>
  <body name="m"><inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/>
    <joint name="m_tx" type="slide" axis="1 0 0" stiffness="{kp}"/><site name="acc1"/>
  </body></worldbody>
  <tendon><spatial name="strut" stiffness="{k}"><site site="ground"/><site site="acc1"/></spatial>
  </tendon></mujoco>
"""


@pytest.fixture(scope="module")
def legs():
    return as_drawn(load_machine(LEGS))


@pytest.mark.parametrize("ratio", [1.4, 2.0, 2.7])
def test_one_mass_has_the_damping_and_gain_of_the_closed_form(tmp_path, ratio):
    mass, parallel = 5.0, 2e4
    zero = np.sqrt(parallel / mass)
    high = ratio * zero
    file = tmp_path / "one.xml"
    file.write_text(ONE.format(m=mass, kp=parallel, k=mass * high**2 - parallel))
    model = as_drawn(load_machine(file))
    result = force_feedback(model, model.drawn, ("strut",), leak_hz=0.0)
    assert result.target_hz == pytest.approx(high / (2 * np.pi))
    assert result.share == pytest.approx(1 - 1 / ratio**2)
    locus = result.loci[0]
    # Preumont: zeta = (W - z) / (2 z) at g = W sqrt(W / z).
    assert locus.damping.max() == pytest.approx((ratio - 1) / 2, rel=2e-3)
    assert locus.gain[locus.best] == pytest.approx(high * np.sqrt(ratio), rel=0.03)
    # s (s^2 + W^2) + g (s^2 + z^2) = 0 on the whole locus.
    s, g = locus.poles, locus.gain
    residual = s * (s**2 + high**2) + g * (s**2 + zero**2)
    assert np.abs(residual).max() < 1e-6 * np.abs(s**3).max()


def test_a_leak_keeps_static_stiffness(tmp_path):
    file = tmp_path / "one.xml"
    file.write_text(ONE.format(m=5.0, kp=0.0, k=8e4))
    model = as_drawn(load_machine(file))
    struts, matrices = find_struts(model, model.drawn, ("strut",)), model.matrices(model.drawn)
    gain, leak = 90.0, 10.0
    dynamics = feedback_dynamics(matrices, struts, gain, leak)
    static = -np.linalg.solve(dynamics, [0.0, 1 / 5.0, 0.0])[0]  # under a force of 1 N
    assert 1 / static == pytest.approx(8e4 * leak / (leak + gain))
    # By default the leak lies a decade below the mode.
    result = force_feedback(model, model.drawn, ("strut",))
    assert result.leak_hz == pytest.approx(result.target_hz / 10)
    share = result.static_share(result.loci[0])
    best = result.loci[0].gain[result.loci[0].best]
    assert share == pytest.approx(1 / (1 + best / (2 * np.pi * result.leak_hz)))


def test_feedback_of_a_hexapods_legs_never_makes_it_unstable_and_names_the_best_pair(legs):
    result = force_feedback(legs, legs.drawn, ("leg*",))
    pairs = [locus for locus in result.loci if len(locus.struts) == 2]
    assert len(result.loci) == 6 + 15 + 1
    assert len(result.loci[0].struts) == 6
    assert result.loci[0].damping.max() > pairs[0].damping.max() > result.target_damping
    struts, matrices = find_struts(legs, legs.drawn, ("leg*",)), legs.matrices(legs.drawn)
    for gain in (1.0, 100.0, 1e4):
        poles = np.linalg.eigvals(feedback_dynamics(matrices, struts, gain, 1.0))
        assert poles.real.max() < 1e-6


def test_machines_of_the_posterior_give_an_interval(legs):
    rng = np.random.default_rng(2)
    thetas = legs.drawn * np.exp(0.02 * rng.standard_normal((8, len(legs.drawn))))
    result = force_feedback(legs, legs.drawn, ("leg1", "leg4"), thetas=thetas)
    low, high = result.interval()
    assert low < result.loci[0].damping.max() * 1.02
    assert high > low > result.target_damping


def test_the_jacobian_of_legs_is_that_of_mujoco(legs):
    spec = mujoco.MjSpec.from_file(str(LEGS))
    spec.body("hexapod").add_site(name="poi", pos=[0.01, 0.02, -0.2])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    own = [k for k in range(model.nv) if model.body(model.dof_bodyid[k]).name == "hexapod"]
    site = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, site[:3], site[3:], model.site("poi").id)
    lengths = np.zeros((6, model.nv))
    for row in range(6):
        unit = np.zeros(model.nv)
        for column in range(model.nv):  # elongation per coordinate, by differences of MuJoCo
            unit[:] = 0
            unit[column] = 1e-6
            ends = []
            for sign in (1, -1):
                data.qpos[:] = sign * unit
                mujoco.mj_forward(model, data)
                ends.append(data.ten_length[row])
            lengths[row, column] = (ends[0] - ends[1]) / 2e-6
    expected = lengths[:, own] @ np.linalg.inv(site[:, own])
    struts = find_struts(legs, legs.drawn, ("leg*",))
    assert platform_of(legs, struts) == "hexapod"
    place = np.array(model.site("poi").pos) + data.body("hexapod").xpos
    found = strut_jacobian(legs, legs.drawn, struts, "hexapod", place)
    assert found == pytest.approx(expected, abs=1e-8)


def test_a_frame_at_the_centre_of_stiffness_decouples_the_static_plant(legs):
    struts = find_struts(legs, legs.drawn, ("leg*",))
    frames = strut_frames(legs, legs.drawn, struts, np.array([0.5, 900.0]))
    jacobian = frames.jacobians["centre of stiffness"]
    stiffness = jacobian.T @ (struts.stiffness[:, None] * jacobian)
    scale = np.sqrt(np.outer(np.diag(stiffness), np.diag(stiffness)))
    assert np.abs((stiffness / scale)[:3, 3:]).max() < 1e-6  # legs of a circle have such a point
    stiff, heavy = frames.coupling["centre of stiffness"], frames.coupling["centre of mass"]
    assert stiff[0] < 1e-4 * heavy[0]  # at rest
    assert heavy[1] < 0.4 * stiff[1]  # far above the suspension


def test_what_is_no_strut_or_no_frame_is_refused(legs):
    with pytest.raises(UsageError, match="no tendon or joint with stiffness is named 'arm'"):
        find_struts(legs, legs.drawn, ("arm",))
    struts = find_struts(legs, legs.drawn, ("leg1", "leg2"))
    with pytest.raises(UsageError, match="a frame needs six struts, and 2 are named"):
        strut_frames(legs, legs.drawn, struts, np.array([1.0]))
