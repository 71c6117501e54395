"""Delays, cross-talk and mounts within tolerance: fitted beside the motion, and never a fault."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from solid_bodies import Case, _read, _transmitted, draw

from identification import check_bodies
from identification.solid.body_channels import body_data, join_tests
from identification.solid.moments import Moments, band_sums, block_edges
from identification.solid.rigid_fit import fit_errors
from identification.solid.sensor_faults import BelievedBody
from identification.words import Tolerance

LINES = 200
PRECISE = {"lines": LINES, "noise": 2e-4}


def faults_of(case: Case):
    (found,) = check_bodies(draw(case))
    return [(fault.effect, fault.location) for fault in found.faults], found


def late(channels: list[int], delays: list[float]):
    """Readings of some channels that come late."""

    def read(freq, values):
        for channel, delay in zip(channels, delays, strict=True):
            values = _read([channel], lambda f, late=delay: np.exp(-2j * np.pi * f * late))(
                freq, values
            )
        return values

    return read


@pytest.mark.parametrize("seed", range(2))
def test_delays_within_tolerance_are_no_fault_however_low_the_noise(seed):
    exact = replace(Tolerance(), sensor_delay=0.0)
    case = Case(seed, **PRECISE, tolerance=exact, read=late([1, 5, 9], [11e-6, 27e-6, 19e-6]))
    campaign = replace(draw(case), tolerance=Tolerance())
    (found,) = check_bodies(campaign)
    assert found.faults == (), found.sentence
    assert not found.has_unexplained


def test_a_sensor_late_by_two_deviations_is_no_fault_and_by_ten_is_one():
    sensor = [3, 4, 5]
    assert faults_of(Case(2, **PRECISE, read=late(sensor, [4e-5] * 3)))[0] == []
    named, found = faults_of(Case(2, **PRECISE, read=late(sensor, [2e-4] * 3)))
    assert named == [("sensor_delay", "sensor:p0_1")]
    assert found.faults[0].parameters["delay"] == pytest.approx(2e-4, abs=3e-5)


def test_a_mount_whose_gain_lies_within_tolerance_is_no_fault():
    stiff = _read([3, 4, 5], partial(_transmitted, 1500.0, 0.05))  # 1.8 % at 200 Hz
    assert faults_of(Case(2, **PRECISE, read=stiff))[0] == []
    soft = _read([3, 4, 5], partial(_transmitted, 400.0, 0.05))
    assert faults_of(Case(2, **PRECISE, read=soft))[0] == [("mount_resonance", "sensor:p0_1")]


def test_delays_and_cross_talk_are_estimated_beside_the_motion():
    rng = np.random.default_rng(4)
    late_by = 2e-5 * rng.normal(size=12)
    tolerance = replace(Tolerance(), sensor_delay=0.0, sensor_gain=1e-6, sensor_cross=0.0)
    tolerance = replace(tolerance, sensor_angle=1e-6, sensor_position=1e-6)
    case = Case(3, **PRECISE, tolerance=tolerance, read=late(list(range(12)), late_by.tolist()))
    campaign = replace(draw(case), tolerance=replace(tolerance, sensor_delay=2e-5))
    data = body_data(join_tests(campaign), campaign, "body0")
    fitted = fit_errors(BelievedBody.healthy(data, campaign.tolerance).model, Moments.of(data))
    found = data.sensors.delays(fitted.errors)
    # Rigid motions share their delay: twelve channels and six motions leave the relative ones.
    centred = late_by - late_by.mean()
    assert np.corrcoef(found - found.mean(), centred)[0, 1] > 0.6
    assert fitted.data < 5 * np.sqrt(LINES * 18)


def test_sums_without_delays_are_those_of_the_advanced_readings():
    rng = np.random.default_rng(5)
    freq = np.linspace(10, 200, 120)
    z = rng.normal(size=(3, 120, 4)) + 1j * rng.normal(size=(3, 120, 4))
    delays = np.array([0.0, 3e-5, -1e-4, 2e-4])
    bands = band_sums(freq, z, [np.ones(3, bool)], block_edges(120))
    np.testing.assert_allclose(bands.power(delays).sum(axis=1), bands.total_power(delays))
    sums = (bands.total_power(delays), *bands.total_slopes(delays))
    omega = 2 * np.pi * freq
    y = z * np.exp(1j * omega[:, None] * delays)
    for power, (found, part) in enumerate(zip(sums, (np.real, np.imag, np.real), strict=True)):
        products = np.einsum("f,kfc,kfd->cd", omega**power, y, y.conj())
        np.testing.assert_allclose(
            found[0], part(products), rtol=0, atol=1e-4 * np.abs(products).max()
        )


def test_without_these_tolerances_a_body_has_no_such_errors():
    case = Case(6, lines=60)
    campaign = draw(case)
    exact = replace(campaign, tolerance=replace(Tolerance(), sensor_delay=0.0, sensor_cross=0.0))
    counts = [body_data(join_tests(one), one, "body0").sensors.count for one in (campaign, exact)]
    assert counts == [12 + 6 * 4 + 3 * 4 + 12, 12 + 6 * 4]
