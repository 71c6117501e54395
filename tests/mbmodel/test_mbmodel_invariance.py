"""What an FRF must not depend on: the order of parts, the origin, the labels' signs and order."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mbmodel_examples import channel_scale, random_request, random_tree, worst_of_channels

from identification.words import Dof
from mbmodel import Model, as_drawn, linearise

FREQ = np.linspace(1, 300, 25)


@settings(max_examples=15, deadline=None)
@given(order=st.permutations(range(6)))
def test_the_order_of_parts_does_not_matter(station_model, away, order):
    frf_request = random_request(station_model.machine, FREQ)
    values_of_parts = station_model.split_parameters(away)
    shuffled = Model(station_model.machine, tuple(station_model.parts[k] for k in order))
    theta = np.concatenate([values_of_parts[k] for k in order])
    expected = linearise(station_model, away, frf_request).values
    # Sums of the same terms in another order, 1e-16, times a condition number of 1e5.
    assert worst_of_channels(linearise(shuffled, theta, frf_request).values, expected) < 1e-10


@settings(max_examples=15, deadline=None)
@given(order=st.permutations(range(6)), seed=st.integers(0, 1000))
def test_the_gradient_follows_the_order_of_parts(station_model, away, order, seed):
    frf_request = random_request(station_model.machine, FREQ)
    lines = linearise(station_model, away, frf_request)
    rng = np.random.default_rng(seed)
    shape = lines.values.shape
    cotangent = (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / channel_scale(lines.values)
    gradient = np.split(lines.gradient(cotangent) * away, 6)
    values_of_parts = station_model.split_parameters(away)
    shuffled = Model(station_model.machine, tuple(station_model.parts[k] for k in order))
    theta = np.concatenate([values_of_parts[k] for k in order])
    shuffled_gradient = linearise(shuffled, theta, frf_request).gradient(cotangent) * theta
    expected = np.concatenate([gradient[k] for k in order])
    np.testing.assert_allclose(shuffled_gradient, expected, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    offset=st.tuples(*[st.floats(-3, 3, allow_subnormal=False)] * 3),
)
def test_the_origin_does_not_matter(from_text, seed, offset):
    here, there = (
        as_drawn(from_text(random_tree(seed, offset=place), name="tree.xml"))
        for place in ((0, 0, 0), offset)
    )
    frf_request = random_request(here.machine, FREQ, seed=seed)
    expected = linearise(here, here.drawn, frf_request).values
    # Positions of up to 4 m rounded to 1e-15 m, levers of 0.1 m and a condition of 1e5.
    assert worst_of_channels(linearise(there, there.drawn, frf_request).values, expected) < 1e-9


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), data=st.data())
def test_labels_may_come_in_any_order_and_sign(from_text, seed, data):
    model = as_drawn(from_text(random_tree(seed), name="tree.xml"))
    frf_request = random_request(model.machine, FREQ, seed=seed)
    frf = linearise(model, model.drawn, frf_request).frf()
    flips = data.draw(st.lists(st.sampled_from([-1, 1]), min_size=5, max_size=5))
    outputs = [
        Dof.of(dof.point, dof.axis, sign) for dof, sign in zip(frf.outputs, flips, strict=True)
    ]
    outputs = data.draw(st.permutations(outputs))
    again = linearise(model, model.drawn, replace(frf_request, outputs=tuple(outputs))).values
    assert worst_of_channels(again, frf.select(outputs, frf.inputs).values) < 1e-12


@pytest.mark.parametrize("factor", [0.2, 7.0])
def test_scaling_all_of_m_c_and_k_scales_the_response_down(from_text, factor):
    # All of inertia, stiffness and damping times f: H / f.
    from_drawn = as_drawn(from_text(random_tree(5)))
    frf_request = random_request(from_drawn.machine, FREQ)
    expected = linearise(from_drawn, from_drawn.drawn, frf_request).values / factor
    machine = from_drawn.machine
    heavier = replace(
        machine, body_mass=machine.body_mass * factor, armature=machine.armature * factor
    )
    scaled = Model(heavier, from_drawn.parts)
    values = linearise(scaled, from_drawn.drawn * factor, frf_request).values
    assert worst_of_channels(values, expected) < 1e-10
