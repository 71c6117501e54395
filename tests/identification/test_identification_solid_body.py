"""Sensors to solid bodies and back: exact for rigid motions, honest about what is not seen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identification_examples import an_estimate, random_layout, read_by_hand

from identification import reconstruct, reduce_to_bodies
from identification.words import Dof, Layout, UsageError

INPUTS = [Dof.parse(text) for text in ("hit1:+tx", "hit1:+ty", "hit2:-tz")]
AXES = [(0, 1, 2), (0,), (1,), (2,), (0, 2)]


def random_motion(seed, n_body, lines=4):
    """Motion of the centres; (line, 6 n_body, input), rotations as large as translations."""
    rng = np.random.default_rng(seed)
    shape = (lines, 6 * n_body, len(INPUTS))
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def readings(layout, outputs, motion):
    return np.stack([read_by_hand(layout, dof, motion) for dof in outputs], axis=1)


def triaxials(layout):
    return [Dof.of(point, axis) for point in layout.points for axis in range(3)]


def condition(layout, outputs):
    """Worst condition number of the bodies."""
    rows = layout.rows(outputs)
    blocks = [rows[:, 6 * b : 6 * b + 6] for b in range(len(layout.bodies))]
    return max(np.linalg.cond(block[block.any(axis=1)]) for block in blocks)


@given(
    seed=st.integers(0, 2**31 - 1),
    n_body=st.integers(1, 3),
    count=st.integers(3, 6),
    data=st.data(),
)
def test_any_rigid_motion_is_recovered_exactly(seed, n_body, count, data):
    layout = random_layout(seed, n_body=n_body, n_sensor=count)
    outputs = []
    for point in layout.points:
        whole = int(point.split("_")[1]) < 3  # three triaxials see all of a body
        axes = AXES[0] if whole else data.draw(st.sampled_from(AXES))
        outputs += [Dof.of(point, axis, data.draw(st.sampled_from([-1, 1]))) for axis in axes]
    outputs = data.draw(st.permutations(outputs))
    motion = random_motion(seed, n_body)
    reduced = reduce_to_bodies(
        an_estimate(readings(layout, outputs, motion), outputs, INPUTS), layout
    )
    assert reduced.frf.outputs == layout.body_dofs()
    assert reduced.frf.inputs == tuple(INPUTS)
    assert reduced.measured.all()
    # Rounding of some ten operations times the condition; the positions are metres from the origin.
    assert np.abs(reduced.frf.values - motion).max() < 1e-13 * condition(layout, outputs)


def world_aligned(seed=5, n_sensor=4):
    layout = random_layout(seed, n_body=1, n_sensor=n_sensor)
    return replace(layout, axes=np.tile(np.eye(3), (n_sensor, 1, 1)))


def matrix_of_the_seed(layout):
    """Equation 2.4, written out."""
    blocks = []
    for x, y, z in layout.positions - layout.centres[0]:
        blocks.append([[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]])
    return np.concatenate(blocks)


def noisy(layout, seed=6, lines=5):
    outputs = triaxials(layout)
    rng = np.random.default_rng(seed)
    shape = (lines, len(outputs), len(INPUTS))
    values = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    return an_estimate(values, outputs, INPUTS, variance=rng.uniform(0.1, 3, shape))


def test_world_aligned_sensors_give_the_moore_penrose_inverse_of_the_seed():
    layout = world_aligned()
    estimate = noisy(layout)
    inverse = np.linalg.pinv(matrix_of_the_seed(layout))
    reduced = reduce_to_bodies(estimate, layout)
    expected = inverse @ estimate.frf.values
    np.testing.assert_allclose(reduced.frf.values, expected, atol=1e-12 * np.abs(expected).max())


def test_the_variance_is_that_of_the_inverse():
    layout = world_aligned()
    estimate = noisy(layout)
    inverse = np.linalg.pinv(matrix_of_the_seed(layout))
    np.testing.assert_allclose(
        reduce_to_bodies(estimate, layout).variance, inverse**2 @ estimate.variance, rtol=1e-9
    )


def test_the_predicted_variance_is_the_scatter_of_noisy_channels():
    # 20000 lines as trials: a mean of |error|^2 scatters by 0.7 %; 4 % over 36 numbers.
    layout = random_layout(8, n_body=2, n_sensor=4)
    outputs, motion = triaxials(layout), random_motion(2, 2, lines=1)
    rng = np.random.default_rng(9)
    clean = readings(layout, outputs, motion)
    variance = rng.uniform(0.01, 1, clean.shape)
    lines = 20000
    error = rng.normal(size=(2, lines, *clean.shape[1:]))
    values = clean + np.sqrt(variance / 2) * (error[0] + 1j * error[1])
    estimate = an_estimate(values, outputs, INPUTS, variance=np.repeat(variance, lines, axis=0))
    reduced = reduce_to_bodies(estimate, layout)
    scatter = (np.abs(reduced.frf.values - motion) ** 2).mean(axis=0)
    np.testing.assert_allclose(scatter, reduced.variance[0], rtol=0.04)


def test_what_else_the_estimate_knows_is_kept_but_the_coherence():
    layout = world_aligned()
    estimate = replace(
        noisy(layout), averages=7, window_tau=0.3, coherence=np.full((5, 12, 3), 0.5)
    )
    reduced = reduce_to_bodies(estimate, layout)
    assert (reduced.averages, reduced.window_tau) == (7, 0.3)
    assert reduced.variance_source == "differences"
    assert reduced.frf.quantity == "accelerance"
    assert reduced.coherence is None


# What the sensors do not see.


def placed(arms, axes=None, centre=(0.4, -0.7, 1.1)):
    """One body and sensors at these arms from its centre."""
    arms, centre = np.array(arms, float), np.array(centre)
    count = len(arms)
    return Layout(
        bodies=("b",),
        centres=centre[None],
        points=tuple(f"p{k}" for k in range(count)),
        body_of=np.zeros(count, int),
        positions=centre + arms,
        axes=random_layout(3, n_body=1, n_sensor=count).axes if axes is None else axes,
    )


UNSEEN = {
    "no arm": ([[0, 0, 0]], "rx ry rz"),
    "one triaxial along x": ([[0.3, 0, 0]], "ty tz rx ry rz"),
    "one triaxial along z": ([[0, 0, -0.2]], "tx ty rx ry rz"),
    "one triaxial in the xy plane": ([[0.3, 0.2, 0]], "tx ty tz rx ry rz"),
    "one triaxial anywhere": ([[0.3, 0.2, -0.5]], "tx ty tz rx ry rz"),
    "two on a line along x through the centre": ([[0.3, 0, 0], [-0.2, 0, 0]], "rx"),
    "two on one side of the centre": ([[0, 0, 0.3], [0, 0, 0.1]], "rz"),
    "a line along x at a height": ([[0.3, 0, 0.2], [-0.2, 0, 0.2]], "ty rx"),
    "a line along x anywhere": ([[0.3, 0.1, 0.2], [-0.2, 0.1, 0.2]], "ty tz rx"),
    "a slant line through the centre": ([[0.3, 0.2, 0], [-0.3, -0.2, 0]], "rx ry"),
    "a slant line anywhere": ([[0.3, 0.2, 0.1], [-0.1, 0.4, -0.3]], "tx ty tz rx ry rz"),
    "three on a line": ([[0.3, 0, 0], [-0.2, 0, 0], [0.1, 0, 0]], "rx"),
    "three in general": ([[0.3, 0, 0], [-0.2, 0.1, 0], [0.1, 0, 0.4]], ""),
}


@pytest.mark.parametrize("name", UNSEEN)
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e3], ids=["m", "km", "mm"])
def test_only_what_is_determined_is_kept_and_it_is_right(name, unit):
    arms, unseen = UNSEEN[name]
    layout = placed(np.array(arms) * unit, centre=np.array([0.4, -0.7, 1.1]) * unit)
    outputs = triaxials(layout)
    motion = random_motion(11, 1) * np.array([unit] * 3 + [1.0] * 3)[:, None]
    reduced = reduce_to_bodies(
        an_estimate(readings(layout, outputs, motion), outputs, INPUTS), layout
    )
    kept = [axis for axis in range(6) if Dof.of("b", axis).direction[1:] not in unseen.split()]
    assert reduced.frf.outputs == tuple(Dof.of("b", axis) for axis in kept)
    assert reduced.measured.all()
    # The positions carry the centre's rounding: 2e-16 of 1 m over arms of 0.1 m.
    np.testing.assert_allclose(reduced.frf.values, motion[:, kept], rtol=1e-11, atol=1e-11 * unit)


def test_single_channels_that_see_a_plane_motion_give_just_that():
    # Two along z at either side in x, world axes: tz and ry.
    layout = placed([[0.3, 0, 0], [-0.2, 0, 0]], axes=np.tile(np.eye(3), (2, 1, 1)))
    outputs = [Dof.parse("p0:+tz"), Dof.parse("p1:-tz")]
    motion = random_motion(12, 1)
    estimate = an_estimate(readings(layout, outputs, motion), outputs, INPUTS)
    reduced = reduce_to_bodies(estimate, layout)
    assert reduced.frf.outputs == (Dof.of("b", 2), Dof.of("b", 4))
    np.testing.assert_allclose(reduced.frf.values, motion[:, [2, 4]], rtol=1e-12)


def test_rotation_sensors_alone_give_the_rotations():
    layout = placed([[0.3, 0.1, 0.2]])
    outputs = [Dof.of("p0", axis) for axis in (3, 4, 5)]
    motion = random_motion(13, 1)
    estimate = an_estimate(readings(layout, outputs, motion), outputs, INPUTS)
    reduced = reduce_to_bodies(estimate, layout)
    assert reduced.frf.outputs == tuple(Dof.of("b", axis) for axis in (3, 4, 5))
    np.testing.assert_allclose(reduced.frf.values, motion[:, 3:], rtol=1e-12)


def test_a_rotation_sensor_completes_two_triaxials():
    layout = placed([[0.3, 0.1, 0.2], [-0.2, 0.1, 0.2]])
    outputs = [*triaxials(layout), Dof.of("p0", 3), Dof.of("p0", 4)]
    motion = random_motion(14, 1)
    estimate = an_estimate(readings(layout, outputs, motion), outputs, INPUTS)
    reduced = reduce_to_bodies(estimate, layout)
    assert reduced.frf.outputs == layout.body_dofs()
    np.testing.assert_allclose(reduced.frf.values, motion, rtol=1e-10)


def test_a_body_without_channels_is_left_out():
    layout = random_layout(15, n_body=3, n_sensor=3)
    outputs = [dof for dof in triaxials(layout) if not dof.point.startswith("p1")]
    motion = random_motion(15, 3)
    estimate = an_estimate(readings(layout, outputs, motion), outputs, INPUTS)
    reduced = reduce_to_bodies(estimate, layout)
    assert {dof.point for dof in reduced.frf.outputs} == {"body0", "body2"}
    expected = motion[:, [*range(6), *range(12, 18)]]
    np.testing.assert_allclose(reduced.frf.values, expected, rtol=1e-9)


def test_channels_missing_for_one_input_mask_its_cells_only():
    # For the second input only two sensors on a line along x through the centre: rx is not seen.
    layout = placed([[0.3, 0, 0], [-0.2, 0, 0], [0.1, 0.2, 0.3]])
    outputs = triaxials(layout)
    motion = random_motion(16, 1)
    values = readings(layout, outputs, motion)
    measured = np.ones((9, 3), bool)
    measured[6:, 1] = False
    values[:, 6:, 1] = 0
    reduced = reduce_to_bodies(an_estimate(values, outputs, INPUTS, measured=measured), layout)
    assert reduced.frf.outputs == layout.body_dofs()
    assert [tuple(map(int, cell)) for cell in np.argwhere(~reduced.measured)] == [(3, 1)]
    assert not reduced.frf.values[:, 3, 1].any()
    assert not reduced.variance[:, 3, 1].any()
    expected = np.where(reduced.measured, motion, 0)
    np.testing.assert_allclose(reduced.frf.values, expected, rtol=1e-11)


def test_an_unmeasured_channel_does_not_enter_though_it_holds_a_value():
    layout = random_layout(17, n_body=1, n_sensor=4)
    outputs = triaxials(layout)
    motion = random_motion(17, 1)
    values = readings(layout, outputs, motion)
    measured = np.ones((12, 3), bool)
    measured[4, 2] = False
    values[:, 4, 2] = 1e6
    reduced = reduce_to_bodies(an_estimate(values, outputs, INPUTS, measured=measured), layout)
    np.testing.assert_allclose(reduced.frf.values, motion, rtol=1e-10)


@given(seed=st.integers(0, 10_000), unit=st.sampled_from([1e-3, 1e3, 39.37, 1e6]))
def test_the_unit_of_length_does_not_matter(seed, unit):
    layout = random_layout(seed, n_body=1, n_sensor=4)
    scaled = replace(layout, centres=layout.centres * unit, positions=layout.positions * unit)
    estimate = noisy(layout, seed)
    here, there = (reduce_to_bodies(estimate, where) for where in (layout, scaled))
    # The readings stay; rotations are per length.
    factor = np.array([1.0] * 3 + [1 / unit] * 3)[:, None]
    np.testing.assert_allclose(there.frf.values, here.frf.values * factor, rtol=1e-7)
    np.testing.assert_allclose(there.variance, here.variance * factor**2, rtol=1e-9)


# And back.


@given(seed=st.integers(0, 2**31 - 1), data=st.data())
def test_reduction_and_back_leaves_rigid_data(seed, data):
    layout = random_layout(seed, n_body=2, n_sensor=4)
    outputs = [replace_sign(d, data.draw(st.sampled_from([-1, 1]))) for d in triaxials(layout)]
    values = readings(layout, outputs, random_motion(seed, 2))
    reduced = reduce_to_bodies(an_estimate(values, outputs, INPUTS), layout)
    back = reconstruct(reduced.frf, tuple(outputs), layout)
    assert back.outputs == tuple(outputs)
    assert back.inputs == tuple(INPUTS)
    assert back.quantity == "accelerance"
    np.testing.assert_allclose(back.values, values, atol=1e-11 * np.abs(values).max())


def replace_sign(dof, sign):
    return Dof.of(dof.point, dof.axis, sign)


def test_reconstruction_predicts_a_sensor_that_was_not_used():
    layout = random_layout(21, n_body=2, n_sensor=4)
    outputs, motion = triaxials(layout), random_motion(21, 2)
    used = [dof for dof in outputs if dof.point != "p1_2"]
    estimate = an_estimate(readings(layout, used, motion), used, INPUTS)
    asked = (Dof.parse("p1_2:-ty"), Dof.parse("p0_0:+rx"), Dof.parse("p1_2:+tx"))
    back = reconstruct(reduce_to_bodies(estimate, layout).frf, asked, layout)
    np.testing.assert_allclose(back.values, readings(layout, asked, motion), rtol=1e-9)


def test_reconstruction_shows_what_is_not_rigid():
    # The residual is what lies outside the six rigid motions of the twelve channels.
    layout = world_aligned()
    estimate = noisy(layout)
    back = reconstruct(reduce_to_bodies(estimate, layout).frf, estimate.frf.outputs, layout)
    matrix = matrix_of_the_seed(layout)
    basis = np.linalg.svd(matrix)[0][:, 6:]
    residual = estimate.frf.values - back.values
    np.testing.assert_allclose(residual, basis @ basis.T @ estimate.frf.values, atol=1e-12)
    # Half of the energy of noise in twelve channels; never of rigid data.
    assert np.linalg.norm(residual) > 0.5 * np.linalg.norm(estimate.frf.values)


def test_one_wrong_channel_shows_in_the_residual_most():
    layout = random_layout(22, n_body=1, n_sensor=4)
    outputs = triaxials(layout)
    values = readings(layout, outputs, random_motion(22, 1))
    values[:, 7] *= -1  # a polarity
    back = reconstruct(
        reduce_to_bodies(an_estimate(values, outputs, INPUTS), layout).frf, tuple(outputs), layout
    )
    residual = np.linalg.norm(values - back.values, axis=(0, 2))
    assert residual.argmax() == 7


def test_a_body_not_fully_determined_is_not_reconstructed():
    layout = placed([[0.3, 0, 0], [-0.2, 0, 0]])
    outputs = triaxials(layout)
    values = readings(layout, outputs, random_motion(23, 1))
    reduced = reduce_to_bodies(an_estimate(values, outputs, INPUTS), layout)
    with pytest.raises(UsageError, match="rx"):
        reconstruct(reduced.frf, tuple(outputs), layout)
