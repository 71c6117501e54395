"""Fast forms of the rigid fit against plain ones: rotations, products of slopes, scans, starts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solid_bodies import Case, draw, faulty

from identification.solid.body_channels import body_data, join_tests
from identification.solid.linearised_scan import LinearisedFit, LineSums
from identification.solid.moments import DelayedSums, Moments
from identification.solid.rigid_fit import fit_errors
from identification.solid.rotation_vectors import compose_rotations, rotation_matrices
from identification.solid.sensor_faults import BelievedBody
from identification.solid.slope_products import nearest_semidefinite, project, solve_definite


def believed(case: Case) -> BelievedBody:
    campaign = draw(case)
    data = body_data(join_tests(campaign), campaign, "body0")
    assert data is not None
    return BelievedBody.healthy(data, campaign.tolerance)


def test_rotations_are_those_of_scipy():
    random = np.random.default_rng(1)
    first, second = random.normal(size=(2, 40, 3)) * np.geomspace(1e-9, 2, 40)[:, None]
    first[0] = second[1] = 0.0
    np.testing.assert_allclose(
        rotation_matrices(first), Rotation.from_rotvec(first).as_matrix(), atol=1e-14
    )
    both = Rotation.from_rotvec(first) * Rotation.from_rotvec(second)
    composed = compose_rotations(first, second)
    np.testing.assert_allclose(composed, both.as_rotvec(), rtol=1e-9, atol=1e-14)
    half = np.array([[0.0, 0.0, 2.5]])
    np.testing.assert_allclose(compose_rotations(half, half), [[0, 0, 5 - 2 * np.pi]])


def test_products_of_slopes_are_those_of_dense_slopes():
    state = believed(Case(41, lines=60))
    model, moments = state.model, Moments.of(state.data, state.reading)
    errors = 0.5 * state.spread * np.random.default_rng(2).normal(size=len(state.spread))
    gradient, information = model.slopes(moments, errors)
    sums, delays = moments.fit_sums(), model.sensors.delays(errors)
    ((clean,), late) = sums.clean(delays), sums.delay_sums(delays)
    assert late is not None
    (first,), (second,) = late
    rows = model.rows(errors) * model.scale[:, None]
    slopes = model.sensors.slopes(errors) * model.scale[:, None]
    projection = project(rows, np.ones(len(rows), bool))
    outside, inverse = projection.residual_projector, projection.inverse
    motion = nearest_semidefinite(inverse @ clean @ inverse.T)
    expected = np.einsum("pcq,qr,cd,sdr->ps", slopes, motion, outside, slopes)
    steep = -2 * np.einsum("pcq,qd,dc->p", slopes, inverse @ clean, outside)
    delays_of_channels = slice(len(errors) - len(rows), None)
    crossed = ((outside @ slopes @ inverse) * first).sum(axis=2)
    expected[:, delays_of_channels] += crossed
    expected[delays_of_channels] += crossed.T
    expected[delays_of_channels, delays_of_channels] += outside * second
    steep[delays_of_channels] -= 2 * (outside * first).sum(axis=1)
    size = np.outer(state.spread, state.spread)
    np.testing.assert_allclose(information * size, expected * size, atol=1e-9)
    np.testing.assert_allclose(gradient * state.spread, steep * state.spread, atol=1e-7)


def test_many_readings_at_once_cost_what_each_costs():
    state = believed(faulty("delay", 3, lines=60)[0])
    moments = Moments.of(state.data, state.reading)
    linear = LinearisedFit.of(state.model, moments, state.start)
    readings = np.exp(-2j * np.pi * state.data.freq_hz * np.linspace(-4e-4, 4e-4, 90)[:, None])
    clean = LineSums.of(state.data, state.reading).divide(readings).clean([3, 4, 5])
    costs = linear.costs(clean, state.spread, 1.0)
    one_by_one = [linear.costs(clean[:, :, [k]], state.spread, 1.0)[0] for k in range(90)]
    np.testing.assert_allclose(costs, one_by_one, rtol=1e-9)
    channels = np.ones((len(state.data.freq_hz), 12), complex)
    channels[:, 3:6] = readings[17][:, None]
    advanced = Moments.of(state.data, channels).fit_sums().clean(np.zeros(12))
    np.testing.assert_allclose(clean[0, :, 17], advanced, atol=1e-6 * np.abs(advanced).max())


@pytest.mark.parametrize("kind", ["gain", "quarter turn", "flexible"])
def test_a_fit_ends_at_a_minimum_and_costs_no_more_than_its_start(kind):
    state = believed(faulty(kind, 5, lines=60)[0])
    total = Moments.of(state.data, state.reading).sum_blocks(slice(None))
    fitted = fit_errors(state.model, total, steps=60)
    nats = fitted.data + fitted.prior
    assert nats <= state.model.data(total, np.zeros(len(state.spread)))
    again = fit_errors(state.model, total, start=fitted.errors, steps=1)
    assert nats - 0.1 < again.data + again.prior <= nats


def test_an_indefinite_system_is_solved_too():
    matrix = np.array([[1.0, 2.0], [2.0, 1.0]])
    np.testing.assert_allclose(solve_definite(matrix, np.array([3.0, 3.0])), [1.0, 1.0])
    definite = believed(Case(1, lines=20)).data.scale
    np.testing.assert_allclose(solve_definite(np.diag(definite), definite), np.ones(len(definite)))


@pytest.mark.parametrize(("groups", "channels"), [(1, 1), (1, 4), (2, 3)])
def test_one_band_has_the_slopes_of_its_two_halves(groups, channels):
    """The memory of the sums is as sums over lines leave it: channels before bands."""
    random = np.random.default_rng(groups)
    shape = (channels, channels, 3, groups, 2)
    halves = (random.normal(size=shape) + 1j * random.normal(size=shape)).transpose(2, 3, 4, 0, 1)
    delays = random.normal(size=channels) * 1e-5
    in_two_bands = DelayedSums(np.array([300.0, 300.0]), halves)
    summed = in_two_bands.sums[:, :, :1] + in_two_bands.sums[:, :, 1:]
    in_one_band = DelayedSums(np.array([300.0]), summed)
    first_half = DelayedSums(np.array([300.0]), halves[:, :, :1])  # a view with gaps
    second_half = DelayedSums(np.array([300.0]), halves[:, :, 1:])
    added = zip(first_half.total_slopes(delays), second_half.total_slopes(delays), strict=True)
    for whole, parts, sum_of_both in zip(
        in_one_band.total_slopes(delays), in_two_bands.total_slopes(delays), added, strict=True
    ):
        np.testing.assert_allclose(whole, parts, rtol=1e-12)
        np.testing.assert_allclose(sum(sum_of_both), parts, rtol=1e-12)
