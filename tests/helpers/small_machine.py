"""A small machine; its virtual tests come from its own equation, so a fit can reach the noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Test,
    Tolerance,
)
from mbmodel import Evaluator, FrfRequest, Model, as_drawn, load_machine

TOLERANCE = Tolerance(
    mass=0.021, inertia=0.052, com=0.0031, joint_position=0.0032, sensor_gain=0.011,
    sensor_angle=0.0171, sensor_position=0.0013, hammer_angle=0.0192, hammer_position=0.0033,
    sensor_delay=2.1e-5, sensor_cross=0.013, hammer_gain=0.022, hammer_delay=1.9e-5,
)  # fmt: skip
MJCF = """
<mujoco model="pair">
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="base">
      <inertial pos="0.02 0.01 0.3" mass="120" diaginertia="4 5 6"/>
      <joint name="base_tx" type="slide" axis="1 0 0" pos="0 0 0.1" stiffness="3e7" damping="3000"/>
      <joint name="base_tz" type="slide" axis="0 0 1" pos="0 0 0.1" stiffness="9e7" damping="5000"/>
      <joint name="base_ry" type="hinge" axis="0 1 0" pos="0 0 0.1" stiffness="4e6" damping="600"/>
      <site name="acc1" pos="0.3 0.1 0.35"/>
      <site name="acc2" pos="-0.3 0.2 0.4"/>
      <site name="acc5" pos="0.1 -0.3 0.45"/>
      <body name="head">
        <inertial pos="0 0.03 0.7" mass="35" diaginertia="1 1.2 0.9"/>
        <joint name="head_tx" type="slide" axis="1 0 0" pos="0 0 0.5"
          stiffness="8e6" damping="700"/>
        <joint name="head_ty" type="slide" axis="0 1 0" pos="0 0 0.5"
          stiffness="6e6" damping="500"/>
        <joint name="head_rz" type="hinge" axis="0 0 1" pos="0 0 0.5" stiffness="3e5" damping="40"/>
        <site name="acc3" pos="0.1 0.15 0.75"/>
        <site name="acc4" pos="-0.2 -0.1 0.8"/>
        <site name="acc6" pos="0.15 -0.12 0.7"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="session")
def drawing(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("pair") / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def model(drawing) -> Model:
    return as_drawn(load_machine(drawing))


@pytest.fixture(scope="session")
def true_theta(model):
    factors = np.exp(np.random.default_rng(5).normal(0, 0.4, len(model.drawn)))
    return model.drawn * factors


def virtual_campaign(
    model, theta, *, noise=0.01, seed=1, taus=(0.0, 0.0, 0.0), lines=160
) -> Campaign:
    """Three hammer directions; each channel's noise is a fraction of its rms."""
    random = np.random.default_rng(seed)
    freq = np.linspace(5.0, 165.0, lines)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 7) for axis in range(3))
    tests = []
    for direction, tau in zip(("+tx", "-ty", "+tz"), taus, strict=True):
        reference = Dof("acc3", direction)
        question = FrfRequest(freq, outputs, (reference,), window_tau=tau)
        condition = Condition("virtual.uff", reference)
        values = Evaluator(model, question, condition=condition).at(theta).values
        rms = np.sqrt((np.abs(values) ** 2).mean(axis=0))
        keep = rms[:, 0] > 1e-9 * rms.max()  # directions without a joint do not move
        sigma = np.broadcast_to(noise * rms, values.shape)
        error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
        noisy = (values + error[0] + 1j * error[1])[:, keep]
        frf = Frf(freq, noisy, tuple(np.array(outputs, object)[keep]), (reference,), "accelerance")
        estimate = FrfEstimate(
            frf,
            sigma[:, keep] ** 2,
            "coherence",
            np.ones(noisy.shape[1:], bool),
            averages=10,
            window_tau=tau,
        )
        tests.append(Test(Condition("virtual.uff", reference), estimate))
    return Campaign("virtual", model.machine.layout, tuple(tests))


@pytest.fixture(scope="session")
def campaign(model, true_theta) -> Campaign:
    return virtual_campaign(model, true_theta)


@pytest.fixture
def flip():
    """The same campaign with one channel and one reference measured along the other sign."""

    def flipped(campaign: Campaign) -> Campaign:
        test = campaign.tests[0]
        frf = test.estimate.frf
        outputs = (Dof.of(frf.outputs[0].point, frf.outputs[0].axis, -1), *frf.outputs[1:])
        values = frf.values.copy()
        values[:, 0] *= -1
        reference = Dof.of(
            test.condition.reference.point,
            test.condition.reference.axis,
            -test.condition.reference.sign,
        )
        new = Frf(frf.freq_hz, -values, outputs, (reference,), frf.quantity)
        turned = Test(replace(test.condition, reference=reference), replace(test.estimate, frf=new))
        return replace(campaign, tests=(turned, *campaign.tests[1:]))

    return flipped


def unit_coordinate(toleranced, place, name, value):
    """Return the x that is zero but at one parameter."""
    x = np.zeros(toleranced.size)
    x[toleranced.coordinate_of[place(name)]] = value
    return x
