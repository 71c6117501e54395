"""Time response: closed form, python-control, and MuJoCo's own integration."""

import control
import mujoco
import numpy as np
import pytest
from mbmodel_examples import STATION, mass_on_spring, mjcf
from test_mbmodel_inputs import driven

from identification.words import Dof, Signal, UsageError
from mbmodel import FrfRequest, as_drawn, load_machine, respond_linearly, state_space

LEGS = STATION.with_name("station_legs.xml")


def burst(time_s, *, low=20.0, high=160.0, length=0.12):
    """A sweep under a smooth window: nothing above 200 Hz."""
    window = np.where(time_s < length, np.sin(np.pi * time_s / length) ** 4, 0.0)
    return window * np.sin(2 * np.pi * (low + (high - low) * time_s / length / 2) * time_s)


def test_one_mass_follows_its_closed_form_under_a_parabola(from_text):
    # m x'' + c x' + k x = t^2 from rest.
    m, k, c = 4.0, 3e4, 11.0
    model = as_drawn(from_text(mjcf(mass_on_spring(m, k, c))))
    time_s = np.linspace(0, 0.5, 41)
    dof = (Dof("acc1", "+tz"),)
    response = respond_linearly(
        model,
        model.drawn,
        FrfRequest(np.ones(1), dof, dof, "receptance"),
        time_s,
        time_s[:, None] ** 2,
    )
    a2 = 1 / k
    a1 = -2 * c * a2 / k
    a0 = -(2 * m * a2 + c * a1) / k
    w, decay = np.sqrt(k / m - (c / 2 / m) ** 2), c / 2 / m
    free = np.exp(-decay * time_s) * (
        -a0 * np.cos(w * time_s) + (-a1 - decay * a0) / w * np.sin(w * time_s)
    )
    expected = a2 * time_s**2 + a1 * time_s + a0 + free
    np.testing.assert_allclose(response[:, 0], expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_python_control_gives_the_same_at_a_fine_step(from_text, quantity):
    model = as_drawn(from_text(driven()))
    inputs = (Signal("push"), Dof("floor", "+tz"), Dof("acc2", "-tz"))
    frf_request = FrfRequest(np.ones(1), (Dof("acc1", "+tz"), Dof("b", "-tz")), inputs, quantity)
    coarse = np.linspace(0, 0.2, 201)
    fine = np.linspace(0, 0.2, 20 * 200 + 1)
    signals = [
        np.stack([burst(t), 2 * burst(t, low=50), -burst(t, high=90)], 1) for t in (coarse, fine)
    ]
    response = respond_linearly(model, model.drawn, frf_request, coarse, signals[0])
    system = state_space(model, model.drawn, frf_request)
    expected = control.forced_response(system, fine, signals[1].T).outputs.T[::20]
    # The first-order hold errs by (w dt)^2 / 12 = 2e-4 at 160 Hz and 50 us, the spline by 1e-5.
    assert np.abs(response - expected).max() < 3e-4 * np.abs(expected).max()


def mujoco_response(path, force, time_end, step, outputs):
    """Displacements of sites in MuJoCo, RK4, the force held at each step's middle value."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = step
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = model.site("acc11").id
    body, point = model.site_bodyid[hit], data.site_xpos[hit].copy()
    direction = data.site_xmat[hit].reshape(3, 3)[:, 1]
    ids = [model.site(name).id for name in outputs]
    start = data.site_xpos[ids].copy()
    push = np.zeros(model.nv)
    steps = round(time_end / step)
    every = steps // 150
    record = []
    for k in range(steps):
        if k % every == 0:
            record.append((data.site_xpos[ids] - start).ravel())
        push[:] = 0.0
        mujoco.mj_applyFT(
            model, data, force((k + 0.5) * step) * direction, np.zeros(3), point, body, push
        )
        data.qfrc_applied[:] = push
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
    return np.array(record)


@pytest.mark.parametrize("path", [STATION, LEGS], ids=["station", "legs"])
def test_the_station_moves_as_in_mujoco_at_small_motion(path):
    model = as_drawn(load_machine(path))
    outputs = ("acc1", "acc7", "acc12", "acc22", "acc14", "acc20")
    dofs = tuple(Dof.of(name, axis) for name in outputs for axis in range(3))
    time_end, samples = 0.15, 150
    time_s = np.arange(samples * 8) * time_end / samples / 8
    force = 3 * burst(time_s)  # at 30 N the kinematics of a rotation squared show: 1.4e-5
    frf_request = FrfRequest(np.ones(1), dofs, (Dof("acc11", "+ty"),), "receptance")
    response = respond_linearly(model, model.drawn, frf_request, time_s, force[:, None])[::8]
    step, before = 2e-5, None
    for _ in range(5):
        expected = mujoco_response(path, lambda t: 3 * burst(np.array(t)), time_end, step, outputs)
        peak = np.abs(expected).max(axis=0)
        if before is not None and (np.abs(expected - before) < 1e-6 * peak).all():
            break
        step, before = step / 2, expected
    else:
        pytest.fail("MuJoCo's step does not settle")
    assert (np.abs(response - expected) < 1e-5 * peak).all()


def test_uneven_time_and_ill_fitting_signals_are_refused(station_model):
    dof = (Dof("acc1", "+tx"),)
    frf_request = FrfRequest(np.ones(1), dof, dof)
    with pytest.raises(UsageError, match="not evenly spaced"):
        respond_linearly(
            station_model, station_model.drawn, frf_request, [0, 1, 3, 4], np.zeros((4, 1))
        )
    with pytest.raises(UsageError, match="at least 4"):
        respond_linearly(
            station_model, station_model.drawn, frf_request, [0, 1, 2], np.zeros((3, 1))
        )
    with pytest.raises(UsageError, match=r"expected \(5, 1\)"):
        respond_linearly(
            station_model, station_model.drawn, frf_request, np.arange(5), np.zeros((4, 1))
        )
