"""Shapes that are scaled, real, at centres of mass, and the full matrix of FRFs."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from identification_examples import random_layout

from identification.modal import (
    MeasuredFrfs,
    classify_pole_stability,
    comac,
    full_matrix_model,
    lscf,
    mac,
    pair_shapes,
    real_shapes,
    scale_shapes,
    shapes_at_bodies,
    signed_comac,
    synthesis_error,
    synthesise_frfs,
)
from identification.modal.lscf_method import Poles
from identification.words import Dof, ModalModel, UsageError

MASS = np.array([[3.0, 0.4, 0.0], [0.4, 2.0, 0.1], [0.0, 0.1, 1.5]])
STIFFNESS = np.array([[9e4, -3e4, 0.0], [-3e4, 7e4, -2e4], [0.0, -2e4, 4e4]])
PROPORTIONAL = 0.8 * MASS + 2e-4 * STIFFNESS
GENERAL = PROPORTIONAL + np.diag([30.0, 0.0, 4.0])
OUTPUTS = (Dof("a1", "+tx"), Dof("b2", "-ty"), Dof("c3", "+tz"))
FREQ = np.linspace(1.0, 60.0, 90)


def state_space_modes(damping, inputs=(0,), signs=(1,), seed=1):
    """A model by the state matrix, with shapes of arbitrary size; the second output looks back."""
    zero = np.zeros((3, 3))
    state = np.block([[zero, np.eye(3)], [-np.linalg.solve(MASS, STIFFNESS)] * 1 + [zero]])
    state[3:, 3:] = -np.linalg.solve(MASS, damping)
    poles, vectors = np.linalg.eig(state)
    order = np.argsort(np.where(poles.imag > 0, poles.imag, np.inf))[:3]
    poles, shapes = poles[order], vectors[:3, order]
    scale = np.array(
        [phi @ (damping + 2 * s * MASS) @ phi for s, phi in zip(poles, shapes.T, strict=True)]
    )
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=3) + 1j * rng.normal(size=3)
    looks = np.array([1, -1, 1])[:, None]
    model = ModalModel(
        poles=poles,
        shapes=looks * shapes * factor,
        participation=np.array(signs)[:, None] * shapes[list(inputs)] / scale / factor,
        lower=np.zeros((3, len(inputs))),
        upper=np.zeros((3, len(inputs))),
        outputs=OUTPUTS,
        inputs=tuple(
            Dof.of(OUTPUTS[k].point, OUTPUTS[k].axis, s) for k, s in zip(inputs, signs, strict=True)
        ),
        freq_sd=np.zeros(3),
        damping_sd=np.zeros(3),
    )
    return model, looks


def receptance(damping):
    s = 2j * np.pi * FREQ[:, None, None]
    return np.linalg.inv(s**2 * MASS + s * damping + STIFFNESS)


def test_real_modes_come_out_mass_normalised_with_a_of_two_i_omega_per_kilogram():
    model, looks = state_space_modes(PROPORTIONAL)
    found = scale_shapes(model)
    _, expected = scipy.linalg.eigh(STIFFNESS, MASS)
    assert found.normalisation == "unit modal mass"
    np.testing.assert_allclose(np.abs(found.model.shapes), np.abs(expected), rtol=1e-9)
    np.testing.assert_allclose(found.modal_a, 2j * model.poles.imag, rtol=1e-9)
    np.testing.assert_allclose(found.model.modal_a, found.modal_a, rtol=1e-9)
    real = real_shapes(found.model.shapes) * looks
    np.testing.assert_allclose(real.T @ MASS @ real, np.eye(3), atol=1e-9)


def test_complex_modes_keep_a_as_the_product_with_the_state_matrix():
    model, looks = state_space_modes(GENERAL)
    found = scale_shapes(model)
    for s, phi, a in zip(
        found.model.poles, (looks * found.model.shapes).T, found.modal_a, strict=True
    ):
        assert phi @ (GENERAL + 2 * s * MASS) @ phi == pytest.approx(a, rel=1e-9)


@pytest.mark.parametrize("damping", [PROPORTIONAL, GENERAL])
@pytest.mark.parametrize(("inputs", "signs"), [((0,), (1,)), ((1, 2), (1, -1))])
def test_the_full_matrix_is_the_inverse_of_the_dynamic_stiffness(damping, inputs, signs):
    model, _ = state_space_modes(damping, inputs, signs)
    full = full_matrix_model(scale_shapes(model)).synthesise(FREQ, "receptance")
    expected = receptance(damping)
    looking_back = np.array([1, -1, 1])
    # outputs look along -ty at b2; an input named by an output's label pushes the same way
    np.testing.assert_allclose(
        full.values, expected * np.outer(looking_back, looking_back), rtol=1e-8, atol=1e-16
    )


def test_the_full_matrix_holds_the_measured_columns_of_a_reciprocal_machine():
    model, _ = state_space_modes(GENERAL, (1, 2), (-1, 1))
    whole = scale_shapes(model)
    full = full_matrix_model(whole).synthesise(FREQ, "accelerance")
    measured = whole.model.synthesise(FREQ, "accelerance")
    np.testing.assert_allclose(
        full.select(measured.outputs, measured.inputs).values, measured.values, rtol=1e-8
    )
    np.testing.assert_allclose(whole.reciprocity, 1.0)


def test_scaling_changes_no_frf():
    model, _ = state_space_modes(GENERAL, (0, 1), (1, 1))
    np.testing.assert_allclose(
        scale_shapes(model).model.synthesise(FREQ, "mobility").values,
        model.synthesise(FREQ, "mobility").values,
        rtol=1e-10,
    )


def test_without_a_drive_point_the_largest_entry_is_one_and_no_full_matrix_is_made():
    model, _ = state_space_modes(GENERAL)
    found = scale_shapes(replace(model, inputs=(Dof("elsewhere", "+tx"),)))
    assert found.normalisation == "largest entry 1"
    assert found.modal_a.size == 0
    np.testing.assert_allclose(np.abs(found.model.shapes).max(axis=0), 1.0)
    with pytest.raises(UsageError, match="drive point"):
        full_matrix_model(found)


def solid_model(seed=4, modes=3):
    """Bodies that move as solids, hit at a point of their own between the sensors."""
    layout = random_layout(seed, n_body=2, n_sensor=5)
    layout = layout.with_copied_point("p1_0", "hit7")
    positions = layout.positions.copy()
    positions[-1] += [0.05, -0.02, 0.03]
    layout = replace(layout, positions=positions)
    rng = np.random.default_rng(seed)
    motion = rng.normal(size=(12, modes)) + 1j * rng.normal(size=(12, modes))
    outputs = tuple(Dof.of(p, axis) for p in layout.points[:-1] for axis in range(3))
    inputs = (Dof("hit7", "+tx"), Dof("hit7", "-tz"))
    poles = np.array([-2 + 90j, -3 + 150j, -1 + 220j])[:modes]
    shapes = layout.rows(outputs) @ motion
    model = ModalModel(
        poles=poles,
        shapes=shapes,
        participation=layout.rows(inputs) @ motion / (2j * poles.imag),
        lower=np.zeros((len(outputs), 2)),
        upper=np.zeros((len(outputs), 2)),
        outputs=outputs,
        inputs=inputs,
        freq_sd=np.zeros(modes),
        damping_sd=np.zeros(modes),
    )
    return model, layout, motion


def test_a_hammer_beside_the_sensor_scales_by_the_solid_body_under_it():
    model, layout, _ = solid_model()
    found = scale_shapes(model, layout)
    assert found.normalisation == "unit modal mass"
    np.testing.assert_allclose(np.abs(found.model.shapes), np.abs(model.shapes), rtol=1e-8)
    np.testing.assert_allclose(found.reciprocity, 1.0)
    assert not scale_shapes(model).has_scale


def test_the_motion_of_solid_bodies_is_found_from_their_sensors():
    model, layout, motion = solid_model()
    found = shapes_at_bodies(model.shapes, model.outputs, layout)
    assert found.dofs == layout.body_dofs()
    np.testing.assert_allclose(found.values, motion, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.reconstructed, model.shapes, rtol=1e-8, atol=1e-10)
    assert found.solid.all()
    assert found.undetermined == ()


def test_directions_that_no_sensor_tells_are_absent():
    model, layout, motion = solid_model()
    rows = [
        k
        for k, dof in enumerate(model.outputs)
        if dof.point not in ("p0_1", "p0_2", "p0_3", "p0_4")
    ]
    outputs = [model.outputs[k] for k in rows]
    found = shapes_at_bodies(model.shapes[rows], outputs, layout)
    assert found.undetermined == ("body0",)
    assert {dof.point for dof in found.dofs if dof.is_rotation} == {"body1"}
    assert not found.solid[:3].any()
    assert np.isfinite(found.values).all()
    whole = [k for k, dof in enumerate(found.dofs) if dof.point == "body1"]
    np.testing.assert_allclose(found.values[whole], motion[6:], rtol=1e-8)


def test_no_mode_has_no_shape():
    model, layout, _ = solid_model()
    found = shapes_at_bodies(model.shapes[:, :0], model.outputs, layout)
    assert found.values.shape == (12, 0)
    assert found.reconstructed.shape == (30, 0)
    assert real_shapes(model.shapes[:, :0]).shape == (30, 0)


@given(st.integers(0, 10_000))
def test_no_other_phase_has_a_larger_real_part(seed):
    rng = np.random.default_rng(seed)
    shapes = rng.normal(size=(5, 2)) + 1j * rng.normal(size=(5, 2)) * rng.random()
    found = (real_shapes(shapes) ** 2).sum(axis=0)
    for angle in np.linspace(0, np.pi, 60):
        assert (((shapes * np.exp(-1j * angle)).real ** 2).sum(axis=0) <= found * (1 + 1e-9)).all()


@given(st.floats(-3, 3))
def test_a_real_shape_stays_itself_at_any_phase(angle):
    shape = np.array([[0.3], [-2.0], [1.0]])
    np.testing.assert_allclose(real_shapes(shape * np.exp(1j * angle)), -shape, atol=1e-12)


def a_measurement(values, variance):
    return MeasuredFrfs(
        freq_hz=FREQ,
        values=values,
        variance=np.full(values.shape, variance),
        measured=np.array([[True], [True], [False]]),
        outputs=OUTPUTS,
        inputs=OUTPUTS[:1],
        order=0,
        decay=0.0,
    )


def test_the_error_of_a_synthesis_is_relative_and_only_where_measured():
    values = receptance(GENERAL)[:, :, :1].copy()
    values[:, 2] = 0
    measured = a_measurement(values, 1e-14)
    found = synthesis_error(measured, 1.25 * values)
    assert found.known.tolist() == [[True], [True], [False]]
    np.testing.assert_allclose(found.error[:2], 0.25)
    np.testing.assert_allclose(found.frac[:2], 1.0)
    size = np.linalg.norm(values[:, 0, 0])
    assert found.noise[0, 0] == pytest.approx(np.sqrt(1e-14 * len(FREQ)) / size)
    assert found.error[2, 0] == found.noise[2, 0] == found.frac[2, 0] == 0


def test_a_window_that_is_still_in_the_data_is_in_the_synthesis_too():
    model, _ = state_space_modes(GENERAL)
    windowed = replace(a_measurement(receptance(GENERAL)[:, :, :1], 0.0), decay=4.0)
    shifted = replace(model, poles=model.poles - 4.0).synthesise(FREQ, "receptance").values
    np.testing.assert_allclose(synthesise_frfs(model, windowed), shifted, rtol=1e-10)


def test_signed_comac_sees_a_turned_channel_that_comac_does_not():
    rng = np.random.default_rng(3)
    shapes = rng.normal(size=(20, 4)) + 0.1j * rng.normal(size=(20, 4))
    turned = shapes * np.array([3, -1j, 2, 0.5])
    turned[2] *= -1
    assert comac(shapes, turned)[2] > 0.7
    found = signed_comac(shapes, turned)
    assert found[2] < -0.9
    assert np.delete(found, 2).min() > 0.9


def test_a_faint_mode_counts_by_its_weight():
    rng = np.random.default_rng(3)
    shapes, other = rng.normal(size=(6, 2)).astype(complex), rng.normal(size=(6, 2)).astype(complex)
    other[:, 0] = shapes[:, 0]
    np.testing.assert_allclose(signed_comac(shapes, other, np.array([1.0, 0.0])), 1.0)


def test_pairs_are_one_to_one_and_need_likeness():
    criterion = np.array([[0.9, 0.85, 0.1], [0.95, 0.2, 0.1], [0.3, 0.1, 0.4]])
    assert pair_shapes(criterion) == [(0, 1), (1, 0)]


def poles_of(order, freq, damping, rows):
    size = 2 * np.pi * np.asarray(freq)
    damping = np.asarray(damping)
    rows = np.asarray(rows, complex).T
    poles = size * (-damping + 1j * np.sqrt(1 - damping**2))
    return Poles(order, poles, rows / np.linalg.norm(rows, axis=0))


def test_poles_are_stable_when_all_three_agree_with_the_order_below():
    one, other = [1, 0.2], [0, 1]
    below = poles_of(1, [10, 20, 30, 40, 50], [0.01, 0.02, 0.01, -0.01, 0.3], [one] * 5)
    here = poles_of(
        2, [10.05, 20.1, 30.1, 40.0, 50.0, 60.0], [0.011, 0.2, 0.0101, 0.01, 0.3, 0.01],
        [one, one, other, one, one, one],
    )  # fmt: skip
    first, second = classify_pole_stability(
        [below, here], frequency=0.01, damping=0.3, participation=0.8, highest_damping=0.25
    )
    assert first.tolist() == [1, 1, 1, 0, 0]
    assert second.tolist() == [4, 2, 3, 1, 0, 1]


def test_no_pole_of_negative_damping_is_ever_stable():
    rng = np.random.default_rng(2)
    values = rng.normal(size=(120, 4, 2)) + 1j * rng.normal(size=(120, 4, 2))
    orders = lscf(np.linspace(1, 60, 120), values, 20)
    kinds = classify_pole_stability(
        orders, frequency=1.0, damping=5.0, participation=0.0, highest_damping=0.9
    )
    unstable = [kind[order.damping <= 0] for kind, order in zip(kinds, orders, strict=True)]
    assert sum(len(kind) for kind in unstable) > 10
    assert all((kind == 0).all() for kind in unstable)


def test_mac_of_shapes_at_other_phases_is_one():
    model, _ = state_space_modes(GENERAL)
    np.testing.assert_allclose(np.diag(mac(model.shapes, 1j * model.shapes)), 1.0)


def turned_round(model):
    return replace(
        model,
        shapes=model.participation,
        participation=model.shapes,
        lower=model.lower.T,
        upper=model.upper.T,
        outputs=model.inputs,
        inputs=model.outputs,
    )


def test_outputs_and_inputs_may_be_exchanged():
    model, _ = state_space_modes(GENERAL, (0, 1), (1, 1))
    model = replace(model, inputs=tuple(dof.positive for dof in model.inputs))
    values = model.synthesise(FREQ, "receptance").values
    measured = replace(
        a_measurement(values, 1e-9), inputs=model.inputs, measured=np.eye(3, 2, dtype=bool)
    )
    turned, beside = turned_round(model), measured.transpose()
    assert turned.outputs == beside.outputs == model.inputs
    assert beside.measured.tolist() == [[True, False, False], [False, True, False]]
    np.testing.assert_allclose(synthesise_frfs(turned, beside), beside.values, rtol=1e-12)
    np.testing.assert_allclose(beside.values, values.transpose(0, 2, 1))
