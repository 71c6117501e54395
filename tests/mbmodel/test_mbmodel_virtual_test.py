"""Virtual hammer tests: FRFs from their records against the linear model, with noise or none."""

import numpy as np
import pytest
from mbmodel_examples import STATION, mjcf

from identification.hits.hit_frfs import estimate_hit_frf
from identification.words import Dof, Tolerance, UsageError
from mbmodel import Evaluator, FrfRequest, Model, as_drawn, load_machine, sensor_parts
from mbmodel.virtual_test.hammer_test import strike
from mbmodel.virtual_test.instruments import NO_ERRORS
from mbmodel.virtual_test.plan import HammerTestPlan, HitScatter, Noise, RecordedFile

# Two masses, each on springs along x and z and about y: modes at 11 to 110 Hz.
BODIES = """
<body name="low"><inertial pos="0 0 0" mass="40" diaginertia="2 2 2"/>
  <joint name="low_tx" type="slide" axis="1 0 0" stiffness="6e5" damping="900"/>
  <joint name="low_tz" type="slide" axis="0.2 0 1" stiffness="9e5" damping="900"/>
  <site name="acc1" pos="0.2 0 0.1"/>
  <body name="high" pos="0.1 0 0.3"><inertial pos="0 0 0" mass="15" diaginertia="1 1 1"/>
    <joint name="high_tx" type="slide" axis="1 0 0" stiffness="2e6" damping="400"/>
    <joint name="high_ry" type="hinge" axis="0 1 0" stiffness="2e5" damping="20"/>
    <site name="acc2" pos="0.1 0.05 0.1"/><site name="hit2" pos="0.1 0.05 0.1"/></body></body>
"""
OUTPUTS = tuple(Dof.of(site, axis) for site in ("acc1", "acc2") for axis in (0, 2))
STEADY_AIM = HitScatter(angle=0.0, place=0.0)


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("two") / "two.xml"
    path.write_text(mjcf(BODIES), encoding="utf-8")
    return load_machine(path)


def plan(reference="hit2:-tx", *, hits=10, scatter=STEADY_AIM, noise=None, level=20.0):
    file = RecordedFile("hits.npz", level, OUTPUTS, (Dof.parse(reference),), hits)
    return HammerTestPlan((file,), 256.0, 2.0, scatter=scatter, noise=noise or Noise())


def compare(machine, records):
    """Return estimate, linear FRFs and lines from 4 Hz to 0.39 of the rate."""
    hits = estimate_hit_frf(records)
    frf, tau = hits.estimate.frf, hits.estimate.window_tau
    lines = (frf.freq_hz > 4) & (frf.freq_hz < 0.39 * records.rate_hz)
    model = as_drawn(machine)
    request = FrfRequest(frf.freq_hz[lines], OUTPUTS, (records.reference,), window_tau=tau)
    linear = Evaluator(model, request).at(model.drawn).values[:, :, 0]
    return hits, frf.values[lines, :, 0], linear, hits.estimate.variance[lines, :, 0]


def test_without_noise_the_frfs_are_those_of_the_linear_model(machine):
    test = strike(machine, plan(hits=2, noise=Noise(0.0, 0.0)))
    (records,) = test.records["hits.npz"]
    hits, measured, linear, _ = compare(machine, records)
    assert len(hits.kept) == 2
    error = np.sqrt((np.abs(measured - linear) ** 2).mean(axis=0))
    assert (error < 5e-3 * np.sqrt((np.abs(linear) ** 2).mean(axis=0))).all()
    assert test.step.error < 3e-3


def test_with_noise_the_stated_variance_is_that_of_the_errors(machine):
    # Ratio of sums as in `excess`; 4 channels of some 160 lines: a standard deviation of 4 %.
    test = strike(machine, plan(hits=20, noise=Noise(2e-3, 2e-3)), seed=3)
    (records,) = test.records["hits.npz"]
    _, measured, linear, variance = compare(machine, records)
    ratio = (np.abs(measured - linear) ** 2).sum(axis=0) / variance.sum(axis=0)
    assert 0.9 < ratio.mean() < 1.1


def test_instrument_errors_show_in_the_frfs_as_their_definitions_say(machine):
    # A gain of the force channel and a delay multiply H by gain exp(-i w delay).
    tolerance = Tolerance(**{**vars(NO_ERRORS), "hammer_gain": 0.2, "hammer_delay": 4e-4})
    test = strike(machine, plan(hits=2, noise=Noise(0.0, 0.0)), tolerance=tolerance, seed=5)
    (records,) = test.records["hits.npz"]
    hits, measured, linear, _ = compare(machine, records)
    channel = test.instruments.force_channels["default"]
    freq = hits.estimate.frf.freq_hz
    lines = (freq > 4) & (freq < 0.39 * 256)
    factor = channel.gain * np.exp(-2j * np.pi * freq[lines] * channel.delay)
    assert abs(channel.gain - 1) > 0.01
    assert abs(channel.delay) > 1e-5
    error = np.abs(measured - factor[:, None] * linear).max(axis=0)
    assert (error < 5e-3 * np.abs(linear).max(axis=0)).all()


def test_sensor_errors_change_readings_as_parts_of_the_model_do(machine):
    # SensorPart is the other implementation of the same definition.
    sizes = {"sensor_gain": 0.1, "sensor_angle": 0.2, "sensor_cross": 0.1, "sensor_delay": 3e-4}
    tolerance = Tolerance(**{**vars(NO_ERRORS), **sizes, "sensor_position": 0.02})
    test = strike(machine, plan(hits=2, noise=Noise(0.0, 0.0)), tolerance=tolerance, seed=8)
    (records,) = test.records["hits.npz"]
    _, measured, linear, _ = compare(machine, records)
    model = Model(machine, sensor_parts(machine))
    theta = np.concatenate(
        [
            np.concatenate([e.gains, e.rotation, e.offset, e.cross, e.delays])
            for e in (test.instruments.sensors[part.point.name] for part in model.parts)
        ]
    )
    freq = np.arange(1 + 512 // 2) / 2.0
    lines = (freq > 4) & (freq < 0.39 * 256)
    with_springs = as_drawn(machine)
    both = Model(machine, (*with_springs.parts, *model.parts))
    request = FrfRequest(freq[lines], OUTPUTS, (records.reference,))
    wanted = Evaluator(both, request).at(np.concatenate([with_springs.drawn, theta]))
    size = np.abs(linear).max()
    assert np.abs(measured - wanted.values[:, :, 0]).max() < 5e-3 * size
    assert np.abs(measured - linear).max() > 5e-2 * size


def test_double_hits_are_seen_and_equal_seeds_give_equal_records(machine):
    double = HitScatter(double_share=1.0)
    first, second = (
        strike(machine, plan(hits=3, scatter=double), seed=2).records["hits.npz"][0]
        for _ in range(2)
    )
    assert np.array_equal(first.motion, second.motion)
    threaded = strike(machine, plan(hits=3, scatter=double), seed=2, threads=3)
    assert np.array_equal(first.motion, threaded.records["hits.npz"][0].motion)
    peaks = (np.diff(np.sign(np.diff(first.force[0]))) < 0) & (first.force[0, 1:-1] > 2.0)
    assert peaks.sum() >= 2


def test_a_plan_out_of_range_is_refused(machine):
    file = RecordedFile("a.npz", 20.0, (Dof.parse("low:+tx"),), (Dof.parse("hit2:+tx"),))
    with pytest.raises(UsageError, match="site of the model"):
        strike(machine, HammerTestPlan((file,)))
    with pytest.raises(UsageError, match="hits per direction"):
        plan(hits=0)
    with pytest.raises(UsageError, match="rate"):
        HammerTestPlan((), rate_hz=0.0)


def test_the_station_answers_as_its_linear_model():
    # One hit and one second: the exponential window of the estimation is in both.
    machine = load_machine(STATION)
    sites = machine.layout.sensors
    outputs = tuple(Dof.of(site, axis) for site in sites for axis in range(3))
    file = RecordedFile("hits.npz", 200.0, outputs, (Dof.parse("acc11:+tx"),), 1)
    quiet = HammerTestPlan((file,), 512.0, 1.0, scatter=STEADY_AIM, noise=Noise(0.0, 0.0))
    (records,) = strike(machine, quiet).records["hits.npz"]
    estimate = estimate_hit_frf(records).estimate
    frf = estimate.frf
    lines = (frf.freq_hz > 4) & (frf.freq_hz < 199)
    model = as_drawn(machine)
    request = FrfRequest(
        frf.freq_hz[lines], outputs, (records.reference,), window_tau=estimate.window_tau
    )
    linear = Evaluator(model, request).at(model.drawn).values
    error = np.sqrt((np.abs(frf.values[lines] - linear) ** 2).mean(axis=0))
    assert len(outputs) == 69
    assert (error < 5e-3 * np.sqrt((np.abs(linear) ** 2).mean(axis=0))).all()
