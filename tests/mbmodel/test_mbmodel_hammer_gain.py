"""The gain of a force channel, and any other factor of the inputs: values and exact slopes."""

from dataclasses import replace

import numpy as np
import pytest

from identification.words import Condition, Dof, Signal
from mbmodel import (
    AddedPart,
    Change,
    Evaluator,
    FrfRequest,
    HammerGainPart,
    Model,
    Parameter,
    hammer_gain_parts,
    hammer_parts,
    load_machine,
    model_edits,
    spring_parts,
)
from tests.helpers.small_machine import MJCF
from tests.helpers.torque_campaign import MOTOR, OUTPUTS, REFERENCES

FREQ = np.linspace(20.0, 150.0, 9)
HIT = Condition("a", Dof("acc3", "+tx"))
DRIVEN = Condition("b", Signal("drive"))
UNIT = np.ones((1, 1))


def delayed(theta):
    """Return the changes of exp(-s delay) - 1."""
    core = np.array([1.0, 0.0, 0.0])[:, None, None]
    factor = Change("input", UNIT, UNIT, core, shape=lambda s: np.exp(-s * theta[0]))
    return (factor, Change("input", UNIT, UNIT, -core))


def delay_slopes(theta):
    """Return the derivative -s exp(-s delay)."""
    core = np.array([[0.0, -1.0, 0.0]])[:, :, None, None]
    return (Change("input", UNIT, UNIT, core, shape=lambda s: np.exp(-s * theta[0])),)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("gain") / "pair.xml"
    path.write_text(MJCF.replace("</mujoco>", MOTOR), encoding="utf-8")
    machine = load_machine(path)
    delay = AddedPart(
        "hammer:default",
        (Parameter("delay", 0.0, "s", positive=False),),
        delayed,
        delay_slopes,
    )
    return Model(
        machine,
        (
            *spring_parts(machine),
            *hammer_parts(machine, (Dof("acc3", "+tx"),)),
            *hammer_gain_parts(("default", "drive"), "unknown_gain"),
            delay,
        ),
    )


def theta_of(model, **values):
    names = {"default": "hammer(default).gain", "drive": "hammer(drive).gain", "delay": "delay"}
    names["late"] = "hammer(default).delay"
    theta = model.drawn.copy()
    for key, value in values.items():
        theta[[p.name for p in model.parameters].index(names[key])] = value
    return theta


def evaluate(model, theta, condition, *, inputs=REFERENCES[:2], direct=True, tau=0.0):
    request = FrfRequest(FREQ, OUTPUTS, inputs, window_tau=tau)
    return Evaluator(model, request, condition=condition, direct=direct).at(theta)


@pytest.mark.parametrize("tau", [0.0, 0.3])
def test_gain_and_delay_multiply_every_frf_of_their_tests(model, tau):
    theta = theta_of(model, default=-3.0, drive=7.0, delay=2e-4)
    plain = evaluate(model, model.drawn, None, tau=tau).values
    factor = np.exp(-2e-4 * (2j * np.pi * FREQ + (1 / tau if tau else 0.0)))[:, None, None]
    hit = evaluate(model, theta, HIT, tau=tau).values
    np.testing.assert_allclose(hit, -3.0 * factor * plain, rtol=1e-10, atol=1e-14)
    lags = evaluate(model, theta_of(model, default=-3.0, late=2e-4), HIT, tau=tau).values
    np.testing.assert_allclose(lags, hit, rtol=1e-10, atol=1e-14)
    drive = evaluate(model, theta, DRIVEN, inputs=(Signal("drive"),), tau=tau).values
    unit = evaluate(model, model.drawn, None, inputs=(Signal("drive"),), tau=tau).values
    np.testing.assert_allclose(drive, 7.0 * factor * unit, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("inputs", [REFERENCES[:2], (Signal("drive"), Dof("floor", "+tx"))])
@pytest.mark.parametrize("direct", [True, False])
def test_slopes_are_exact_forward_and_adjoint(model, direct, inputs):
    random = np.random.default_rng(2)
    theta = theta_of(model, default=1.7, drive=0.4, delay=3e-4, late=-2e-4)
    named = [parameter.name for parameter in model.parameters]
    theta[[k for k, name in enumerate(named) if "acc3:tx" in name]] += random.normal(0, 0.02, 6)
    at = evaluate(model, theta, HIT, inputs=inputs, direct=direct)
    columns = at.columns()
    for k in range(len(theta)):
        step = 1e-6 * max(abs(theta[k]), 1e-2 if "delay" not in named[k] else 1e-4)
        moved = [theta + np.where(np.arange(len(theta)) == k, s * step, 0.0) for s in (1, -1)]
        up, down = (evaluate(model, m, HIT, inputs=inputs).values for m in moved)
        slope = (up - down) / (2 * step)
        np.testing.assert_allclose(
            columns[..., k],
            slope,
            rtol=2e-5,
            atol=1e-7 * abs(slope).max() + 1e-9 * abs(up).max() / step,
        )
    cotangent = random.normal(size=at.values.shape) + 1j * random.normal(size=at.values.shape)
    expected = np.einsum("fio,fiop->p", cotangent.conj(), columns).real
    np.testing.assert_allclose(at.gradient(cotangent), expected, rtol=1e-9, atol=1e-12)


def test_nothing_acts_apart_from_a_test_and_an_mjcf_holds_no_gain(model):
    theta = theta_of(model, default=5.0)
    np.testing.assert_array_equal(
        evaluate(model, theta, None).values, evaluate(model, model.drawn, None).values
    )
    assert any(
        getattr(edit, "reason", "") == "an MJCF describes no force channel"
        for edit in model_edits(model, theta)
    )
    assert model.acting_fractions(HIT) == (1.0, 0.0, 1.0)
    assert model.acting_fractions(DRIVEN) == (0.0, 1.0, 1.0)


def test_the_gain_of_the_hits_at_one_reference_acts_there_alone(model):
    part = HammerGainPart("default", "hammer_gain", HIT.reference.positive)
    assert [parameter.name for parameter in part.parameters] == ["hammer(acc3:tx).gain"]
    own = Model(model.machine, (*spring_parts(model.machine), part))
    theta = np.where(np.arange(len(own.drawn)) == len(own.drawn) - 1, 1.3, own.drawn)
    elsewhere = Condition("c", Dof("acc3", "+ty"))
    other_hammer = replace(HIT, hammer="other")
    for condition, gain in ((HIT, 1.3), (elsewhere, 1.0), (other_hammer, 1.0)):
        at = evaluate(own, theta, condition)
        plain = evaluate(own, own.drawn, condition).values
        np.testing.assert_allclose(at.values, gain * plain, rtol=1e-12)
        slope = at.columns()[..., -1]
        np.testing.assert_allclose(slope, plain if gain > 1 else 0 * plain, rtol=1e-10, atol=1e-16)
