"""Differences of forces leave out steps of MuJoCo that no force needs: all forces stay the same."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from mbmodel.linearisation.force_slopes import FORCE_DIFFERENCE_STEP, compute_forces, force_slopes
from mbmodel.linearisation.force_slopes import net_force as net

ASSETS = Path(__file__).resolve().parents[2] / "assets"
MODELS = ("two_bodies.xml", "microstation/station.xml")


@pytest.mark.parametrize("along", ["position", "velocity"])
@pytest.mark.parametrize("name", MODELS)
def test_slopes_are_those_of_all_steps(name, along):
    model = mujoco.MjModel.from_xml_path(str(ASSETS / name))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    steady = np.linspace(0.05, 0.1, model.nv)  # gyroscopic forces depend on the velocity
    slope, _ = force_slopes(model, data, along, steady)
    for column in (0, model.nv - 1):
        forces = []
        for sign in (1.0, -1.0):
            probe, shift = mujoco.MjData(model), np.zeros(model.nv)
            shift[column] = sign * FORCE_DIFFERENCE_STEP
            probe.qpos[:], probe.qvel[:] = data.qpos, steady
            if along == "position":
                mujoco.mj_integratePos(model, probe.qpos, shift, 1.0)
            else:
                probe.qvel[:] += shift
            compute_forces(model, probe)
            forces.append(net(model, probe).copy())
        expected = -(forces[0] - forces[1]) / (2 * FORCE_DIFFERENCE_STEP)
        np.testing.assert_array_equal(slope[:, column], expected)
