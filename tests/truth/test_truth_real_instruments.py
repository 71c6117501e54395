"""Instruments that are late, read across their axes and have a wrong calibration of the force."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from identification.words import Condition, Dof
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    hammer_gain_parts,
    load_machine,
    sensor_parts,
    spring_parts,
)
from truth.campaign.draw import (
    NO_TOLERANCE,
    REAL_INSTRUMENTS,
    Tolerances,
    draw_hammers,
    draw_true,
)
from truth.campaign.file_formats import model_xml
from truth.campaign.frf_sensitivities import jacobian, stack_parts
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.measure import hammer_test
from truth.campaign.protocol import Protocol, takes
from truth.campaign.tolerance_answer import subtract_drawing
from truth.effects.effect import Answer
from truth.machine.rig import Prepared, accelerance, build

FREQ = np.linspace(10.0, 190.0, 7)
KEYS = "sensor_delay", "sensor_cross", "hammer_gain", "hammer_delay"
ONLY = replace(NO_TOLERANCE, **{key: getattr(REAL_INSTRUMENTS, key) for key in KEYS})


@pytest.fixture(scope="module")
def real(two_bodies):
    return TrueMachine(
        draw_true(two_bodies, REAL_INSTRUMENTS, 5), draw_hammers(two_bodies, 1, REAL_INSTRUMENTS, 5)
    )


def changed_sensor(machine, number, **changes):
    """The machine with one sensor of its first stage changed."""
    stage, *others = machine.station.stages
    sensors = list(stage.sensors)
    sensors[number] = replace(sensors[number], **changes)
    stages = (replace(stage, sensors=tuple(sensors)), *others)
    return replace(machine, station=replace(machine.station, stages=stages))


def frfs(machine):
    return accelerance(build(Prepared(machine.station, machine.hammers)), FREQ)


def test_their_draws_leave_all_others_alone(two_bodies, real):
    plain = draw_true(two_bodies, Tolerances(), 5)
    pairs = zip(plain.sensors(), real.station.sensors(), strict=True)
    for (_, ideal), (_, sensor) in pairs:
        for name in ("axes", "position", "gain"):
            np.testing.assert_array_equal(getattr(ideal, name), getattr(sensor, name))
        assert not ideal.delay.any()
        assert (np.abs(sensor.delay) > 0).all()
        assert (np.abs(sensor.cross) > 0).all()
    hits = draw_hammers(two_bodies, 1, Tolerances(), 5)
    for ideal, hammer in zip(hits, real.hammers, strict=True):
        np.testing.assert_array_equal(ideal.direction, hammer.direction)
    assert len({(hammer.gain, hammer.delay) for hammer in real.hammers}) == 1
    assert asdict(Tolerances()) == {**asdict(REAL_INSTRUMENTS), **dict.fromkeys(KEYS, 0.0)}


def test_their_errors_have_the_stated_standard_deviations(two_bodies):
    draws = [draw_true(two_bodies, REAL_INSTRUMENTS, seed) for seed in range(150)]
    sensors = [sensor for true in draws for _, sensor in true.sensors()]
    hammers = [draw_hammers(two_bodies, 1, REAL_INSTRUMENTS, seed)[0] for seed in range(150)]
    for key, values in (
        ("sensor_delay", np.concatenate([sensor.delay for sensor in sensors])),
        ("sensor_cross", np.concatenate([sensor.cross for sensor in sensors])),
        ("hammer_gain", np.array([hammer.gain - 1 for hammer in hammers])),
        ("hammer_delay", np.array([hammer.delay for hammer in hammers])),
    ):
        assert values.std() == pytest.approx(getattr(REAL_INSTRUMENTS, key), rel=0.25)


def test_the_force_channel_multiplies_what_is_measured(two_bodies):
    protocol = Protocol((1,), lines=41, resolution_hz=4.0)
    hammers = draw_hammers(two_bodies, 1, NO_TOLERANCE, 1)
    wrong = tuple(replace(hammer, gain=1.03, delay=-4e-5) for hammer in hammers)
    (take,) = takes(protocol, two_bodies, 1)
    right, late = (
        hammer_test(TrueMachine(two_bodies, h), protocol, take, 3) for h in (hammers, wrong)
    )
    factor = 1.03 * np.exp(2j * np.pi * protocol.freq_hz * 4e-5)
    np.testing.assert_allclose(late.frf, factor[:, None, None] * right.frf, rtol=1e-10)
    np.testing.assert_allclose(late.coherence[1:], right.coherence[1:], rtol=1e-9)


def test_the_refit_knows_the_slopes_by_each_of_them(real):
    weight = np.ones((len(FREQ), len(frfs(real)[0]), 3))
    slopes = jacobian(real, FREQ, ONLY, weight)
    sensor = real.station.stages[0].sensors[1]
    for place in range(3):
        for first, key, step in ((9, "cross", 1e-3), (12, "delay", 1e-6)):
            unit = np.eye(3)[place] * step
            ends = [
                frfs(changed_sensor(real, 1, **{key: getattr(sensor, key) + way * unit}))
                for way in (1, -1)
            ]
            slope = (ends[0] - ends[1])[:, 3:6] / (2 * step) * getattr(ONLY, f"sensor_{key}")
            np.testing.assert_allclose(
                slopes.of_sensors[1][:, first + place],
                stack_parts(slope),
                atol=1e-6 * np.abs(slope).max(),
            )
    values = frfs(real)
    s = 2j * np.pi * FREQ[:, None, None]
    for column, slope in ((-2, 0.02 * values), (-1, -2e-5 * s * values)):
        np.testing.assert_allclose(
            slopes.tolerances[:, column], stack_parts(slope), atol=1e-10 * np.abs(slope).max()
        )


def test_without_their_tolerances_the_refit_has_no_columns_for_them(real):
    weight = np.ones((len(FREQ), len(frfs(real)[0]), 3))
    with_them, without = (jacobian(real, FREQ, each, weight) for each in (ONLY, NO_TOLERANCE))
    assert (with_them.of_sensors.shape[2], without.of_sensors.shape[2]) == (15, 9)
    assert with_them.tolerances.shape[1] == without.tolerances.shape[1] + 2


def test_an_answer_states_the_whole_delay(two_bodies, real):
    prepared = Prepared(real.station, real.hammers)
    (_, sensor), *_ = real.station.sensors()
    answer = Answer("sensor_delay", f"sensor:acc{sensor.node}", parameters={"delay": 3e-4})
    whole = subtract_drawing(answer, two_bodies, real.station, prepared).parameters["delay"]
    assert whole == pytest.approx(3e-4 + sensor.delay.mean())


def test_both_programs_mean_the_same_by_each_of_them(two_bodies, tmp_path):
    true, hammers = draw_true(two_bodies, ONLY, 8), draw_hammers(two_bodies, 1, ONLY, 8)
    path = tmp_path / "model.xml"
    path.write_text(model_xml(two_bodies), encoding="utf-8")
    machine = load_machine(path)
    force = hammer_gain_parts(["default"], "hammer_gain")
    model = Model(machine, (*spring_parts(machine), *sensor_parts(machine), *force))
    values = {"hammer(default).gain": hammers[0].gain, "hammer(default).delay": hammers[0].delay}
    for _, sensor in true.sensors():
        site = f"acc{sensor.node}"
        pairs = zip(("xy", "xz", "yz"), sensor.cross, strict=True)
        values |= {f"{site}.cross_{axes}": size for axes, size in pairs}
        values |= {f"{site}.delay_{a}": d for a, d in zip("xyz", sensor.delay, strict=True)}
    theta = np.array([values.get(p.name, p.drawn) for p in model.parameters])
    nodes = [sensor.node for _, sensor in true.sensors()]
    outputs = tuple(Dof.of(f"acc{node}", axis) for node in nodes for axis in range(3))
    inputs = tuple(Dof.of("acc1", axis) for axis in range(3))
    condition = Condition("a", inputs[0])
    theirs = Evaluator(model, FrfRequest(FREQ, outputs, inputs), condition=condition).at(theta)
    factor = hammers[0].gain * np.exp(-2j * np.pi * FREQ * hammers[0].delay)
    ours = factor[:, None, None] * accelerance(build(Prepared(true, hammers)), FREQ)
    assert (np.abs(ours - theirs.values) / np.abs(ours).max(axis=0)).max() < 1e-9
