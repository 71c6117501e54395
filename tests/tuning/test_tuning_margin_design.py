"""What limits a loop: margins of stable and unstable loops, notches and changes of the machine."""

from dataclasses import replace

import control
import numpy as np
import pytest
from budget_case import (
    BUDGET,
    LOOP_DELAY,
    VALUES,
    spring_posterior,
    write_machine,
    write_tuned_case,
)

import mbworkbench as mb
from identification.words import InputError, UsageError
from mbmodel import Model, as_drawn, body_parts, joint_parts, load_machine
from mbw.plant.margin_schema import StepRow
from mbw.plant.margin_sentences import step_sentence
from tuning.plant.control_loops.allowed_gains import allowed_gains, crossover_of, notch_response
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.margin_design import design_loops
from tuning.plant.error_budget.read_definition import read_definition

# The force acts on the base and the head is read: the base's mode limits the gain.
LOOP = """
band = [1, 100]
[loop.a]
input = "acc1:+tx"
output = "acc2:+tx"
controller = {{ zeros = [-30.0], poles = [-600.0], gain = {gain} }}
"""
STABLE, UNSTABLE = 2e5, 2e7


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = write_machine(tmp_path_factory.mktemp("two"))
    for gain in (STABLE, UNSTABLE):
        (place / f"{gain:g}.toml").write_text(LOOP.format(gain=gain))
    return place


def loop_by_hand(gain):
    """L of python-control."""
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    s = control.tf("s")
    across = c2 * s + k2
    determinant = (m1 * s**2 + (c1 + c2) * s + k1 + k2) * (m2 * s**2 + across) - across**2
    return control.minreal(gain * (s + 30) / (s + 600) * across / determinant, verbose=False)


@pytest.mark.parametrize("gain", [STABLE, UNSTABLE])
def test_margins_and_the_largest_gain_are_those_of_python_control(place, gain):
    (loop,) = mb.margins(place / "two.xml", place / f"{gain:g}.toml").loops
    exact = loop_by_hand(gain)
    np.testing.assert_allclose(loop.gains, exact(2j * np.pi * loop.freq_hz), rtol=1e-6)
    is_stable = bool((control.feedback(exact).poles().real < 0).all())
    assert (loop.pole is None) == is_stable == (gain == STABLE)
    gm, _, sm, *_ = control.stability_margins(exact)
    if is_stable:
        assert loop.margins.gain.value == pytest.approx(gm, rel=1e-4)
        assert loop.margins.modulus.value == pytest.approx(sm, rel=1e-4)
    else:
        worst = max(control.feedback(exact).poles(), key=lambda pole: pole.real)
        assert loop.pole.real == pytest.approx(worst.real, rel=1e-6)
    # At the largest gain the loop is stable with the margin that was asked for, beyond it without.
    for factor, holds in ((1.0, True), (1.02, False)):
        scaled = factor * loop.gain * exact
        modulus = control.stability_margins(scaled)[2]
        assert (control.feedback(scaled).poles().real < 0).all()
        assert (modulus > 0.5 * (1 - 1e-3)) == holds
    assert abs(loop.gain * exact(2j * np.pi * loop.crossover_hz)) == pytest.approx(1.0, rel=5e-3)


def test_the_limiting_mode_is_named_with_its_part_and_a_notch(place):
    result = mb.margins(place / "two.xml", place / f"{UNSTABLE:g}.toml")
    (loop,) = result.loops
    mode = loop.modes[0]
    assert mode.gain == pytest.approx(loop.gain)
    assert next(iter(mode.springs)) == "base_tx"
    assert next(iter(mode.bodies)) == "base"
    s, w = control.tf("s"), 2 * np.pi * mode.freq_hz
    notch = (s**2 + mode.notch * w * s + w**2) / (s**2 + w * s + w**2)
    at = 2j * np.pi * loop.crossover_hz
    assert np.angle(notch(at), deg=True) == pytest.approx(mode.notch_phase_deg, abs=1e-6)
    # With the notch the largest gain has the margin too, and a larger crossover.
    with_notch = loop.gains * notch_response(loop.freq_hz, mode.freq_hz, mode.notch)
    gain = allowed_gains(with_notch, 0.5, loop.gain).min()
    scaled = gain * loop_by_hand(UNSTABLE) * notch
    assert (control.feedback(scaled).poles().real < 0).all()
    assert control.stability_margins(scaled)[2] == pytest.approx(0.5, rel=5e-3)
    assert mode.notch_crossover_hz == pytest.approx(crossover_of(loop.freq_hz, with_notch, gain))
    assert mode.notch_crossover_hz > loop.crossover_hz
    text = repr(result)
    assert "unstable, the pole at 35.31 Hz grows" in text
    assert "10 % more of base_tx.stiffness" in text
    assert len(result.plot().data) == 4
    assert result.table().rows[0][0] == "a"


def test_large_changes_and_long_times_are_written_without_an_exponent(place):
    (loop,) = mb.margins(place / "two.xml", place / f"{UNSTABLE:g}.toml").loops
    mode = replace(loop.modes[0], changes={"a strut": 1.24, "10 % more of k": -0.0058})
    lines = replace(loop, modes=(mode,)).limit_sentences()
    assert lines[-2:] == ["  a strut: +124 % of the gain", "  10 % more of k: -0.58 % of the gain"]
    step = StepRow(final=1.0, overshoot=0.0, rise_time_s=1.003, settling_time_s=None)
    assert "rise time 1000 ms, settling time to 2 % none" in step_sentence(step)


def test_changes_of_the_machine_are_those_of_differences(place):
    machine = load_machine(place / "two.xml")
    definition = read_definition(place / f"{STABLE:g}.toml", machine, loops_suffice=True)
    (loop,) = design_loops(as_drawn(machine), definition)
    model = as_drawn(machine)
    whole = Model(machine, (*model.parts, *body_parts(machine), *joint_parts(machine)))
    plant = LoopPlant.of(whole, definition)
    near = np.linspace(0.97, 1.03, 20_001) * loop.modes[0].at_hz

    def largest(theta):
        curve = plant.gain_at(theta)(near)[:, 0, 0]
        return np.log(allowed_gains(curve, 0.5, 1.0).min())

    names = [parameter.name for parameter in whole.parameters]
    tested = ("base_tx.stiffness", "base_tx.damping", "head_tx.stiffness", "head.mass", "base.mass")
    changes = loop.modes[0].changes
    for name in tested:
        number, step = names.index(name), 1e-3
        ends = []
        for sign in (1, -1):
            theta = whole.drawn.copy()
            theta[number] *= 1 + sign * step
            ends.append(largest(theta))
        slope = (ends[0] - ends[1]) / (2 * step)
        stated = np.log1p(changes[f"10 % more of {name}"]) / np.log(1.1)
        assert stated == pytest.approx(slope, rel=1e-2, abs=1e-4)


TILT = """
<mujoco model="tilt"><option gravity="0 0 0"/><worldbody>
  <body name="plate"><inertial pos="0 0 0" mass="9" diaginertia="0.2 0.3 0.4"/>
    <joint name="plate_tz" type="slide" axis="0 0 1" stiffness="4e5" damping="60"/>
    <joint name="plate_ry" type="hinge" axis="0 1 0" stiffness="3e4" damping="2"/>
    <site name="acc1" pos="{sensor} 0.02 0.1"/><site name="hit1" pos="{force} 0 0"/>
  </body></worldbody></mujoco>
"""


def test_a_moved_sensor_and_a_moved_force_change_the_gain_as_drawn(tmp_path):
    toml = LOOP.format(gain=2e5).replace("acc1:+tx", "hit1:+tz").replace("acc2:+tx", "acc1:+tz")
    (tmp_path / "tilt.toml").write_text(toml)

    def limit(sensor=0.15, force=-0.12):
        file = tmp_path / f"tilt{sensor}{force}.xml"
        file.write_text(TILT.format(sensor=sensor, force=force))
        return mb.margins(file, tmp_path / "tilt.toml").loops[0].modes[0]

    mode, step = limit(), 1e-4
    for name, ends in (
        ("acc1", (limit(sensor=0.15 + step), limit(sensor=0.15 - step))),
        ("hit1", (limit(force=-0.12 + step), limit(force=-0.12 - step))),
    ):
        slope = np.log(ends[0].gain / ends[1].gain) / (2 * step)
        stated = mode.changes[f"{name} moved by 10 mm along x"]
        assert np.log1p(stated) / 0.01 == pytest.approx(slope, rel=0.02)


def test_the_largest_crossover_has_a_band_over_the_posterior(tmp_path):
    write_tuned_case(tmp_path)
    (tmp_path / "loop.toml").write_text(LOOP.format(gain=STABLE))
    (loop,) = mb.margins(tmp_path / "x-tuned", tmp_path / "loop.toml").loops
    model = as_drawn(load_machine(tmp_path / "x-tuned" / "tuned.xml"))
    assert len(loop.samples_hz) == 60
    assert loop.samples_hz.min() < loop.crossover_hz < loop.samples_hz.max()
    theta = spring_posterior(model).sample(60, 1)[7]
    assert loop.sample_gains.shape == (60, len(loop.freq_hz))
    definition = read_definition(tmp_path / "loop.toml", model.machine, loops_suffice=True)
    exact = LoopPlant.of(model, definition)
    np.testing.assert_allclose(
        loop.sample_gains[7], exact.gain_at(theta)(loop.freq_hz)[:, 0, 0], rtol=1e-9
    )


def test_a_loop_that_its_delay_limits_names_no_mode(place):
    (place / "delay.toml").write_text(BUDGET.format(gain=3e5, delay=LOOP_DELAY, lines=""))
    result = mb.margins(place / "two.xml", place / "delay.toml")
    assert "no mode of the machine limits it" in repr(result)


CAR = """
<mujoco model="car"><option gravity="0 0 0"/><worldbody><body name="car">
  <inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
  <joint name="x" type="slide" axis="1 0 0"/></body></worldbody>
  <actuator><motor name="force" joint="x"/></actuator></mujoco>
"""
INTEGRATOR = """
[loop.a]
input = "force"
output = "joint:x"
controller = {{ zeros = [], poles = [0.0, -2e5], gain = {gain} }}
"""


@pytest.mark.parametrize("gain", [1e-3, 1.0, 1e6])
def test_no_gain_of_an_integrator_on_a_free_axis_is_stable(tmp_path, gain):
    # m s^3 (s + 2e5) + gain = 0 has two roots on the right however small the gain.
    (tmp_path / "car.xml").write_text(CAR)
    (tmp_path / "integrator.toml").write_text(INTEGRATOR.format(gain=gain))
    (loop,) = mb.margins(tmp_path / "car.xml", tmp_path / "integrator.toml").loops
    expected = np.roots([10.0, 2e6, 0.0, 0.0, gain])
    assert loop.pole.real == pytest.approx(expected.real.max(), rel=1e-4)
    assert not loop.is_limited


def test_forbidden_gains_of_a_point_are_a_circle():
    # |1 + g L| = m at both ends, and at 1 / |L| on the real axis within.
    gains = np.array([-0.5 + 0.1j, -2.0, 0.3 + 1j, -1e-3 - 1.0j])
    allowed = allowed_gains(gains, 0.5, 0.0)
    np.testing.assert_allclose(np.abs(1 + allowed[:2] * gains[:2]), 0.5)
    assert np.isinf(allowed[2:]).all()
    assert allowed_gains(gains[1:2], 0.5, 0.4)[0] == pytest.approx(0.25)  # it falls first
    assert np.isinf(allowed_gains(gains[1:2], 0.5, 2.0)[0])


def test_margins_without_a_loop_are_refused(place):
    (place / "none.toml").write_text("band = [1, 9]\n")
    with pytest.raises(InputError, match="has no loop, and so no margins"):
        mb.margins(place / "two.xml", place / "none.toml")
    with pytest.raises(UsageError, match="between 0 and 1"):
        mb.margins(place / "two.xml", place / f"{STABLE:g}.toml", modulus=2.0)


TOWER = """
<mujoco model="tower"><option gravity="0 0 0"/><worldbody><site name="wall" pos="0.1 0.02 0.9"/>
  <body name="base"><inertial pos="0 0 0" mass="20" diaginertia="0.4 0.5 0.6"/>
    <joint name="base_tx" type="slide" axis="1 0 0" stiffness="4e6" damping="300"/>
    <joint name="base_ry" type="hinge" axis="0 1 0" stiffness="3e5" damping="20"/>
    <site name="hit1" pos="-0.2 0 0.1"/>
    <body name="head" pos="0 0 0.4"><inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.1"/>
      <joint name="head_tx" type="slide" axis="1 0 0" stiffness="8e5" damping="60"/>
      <joint name="head_ry" type="hinge" axis="0 1 0" stiffness="4e4" damping="3"/>
      <site name="acc2" pos="0.1 0.02 0.1" euler="0 30 10"/>
    </body></body></worldbody>
  <tendon><spatial name="strut" stiffness="{stiffness}"><site site="{first}"/><site site="acc2"/>
  </spatial></tendon></mujoco>
"""


@pytest.mark.parametrize(
    ("first", "number", "name"),
    [("hit1", 1, "between hit1 and acc2"), ("wall", 0, "from acc2 to the ground along z")],
)
def test_a_strut_changes_the_gain_as_a_drawn_one(tmp_path, first, number, name):
    toml = LOOP.format(gain=2e6).replace("acc1:+tx", "hit1:+tx")
    (tmp_path / "tower.toml").write_text(toml)

    def limit(stiffness):
        file = tmp_path / f"tower{stiffness}.xml"
        file.write_text(TOWER.format(stiffness=stiffness, first=first))
        return mb.margins(file, tmp_path / "tower.toml").loops[0].modes[number]

    mode = limit(0.0)
    (label,) = (text for text in mode.changes if name in text)
    stiffness, step = float(label.split()[3]), 3e2
    ends = np.log([limit(count * step).gain / mode.gain for count in (1, 2)])
    slope = (4 * ends[0] - ends[1]) / (2 * step)
    assert abs(slope * stiffness) > 0.01
    assert np.log1p(mode.changes[label]) / stiffness == pytest.approx(slope, rel=0.03)
