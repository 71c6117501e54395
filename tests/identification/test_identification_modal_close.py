"""Modes at one frequency: their shapes follow from the residue matrix of all references."""

import numpy as np
import pytest

from identification.modal import full_matrix_model, identify, scale_shapes
from identification.modal.close_modes import factor_symmetric, group_close_poles
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

FREQ = np.arange(1, 401) * 0.25
QUANTITY = "accelerance"
OUTPUTS = tuple(Dof(f"acc{k}", "+tz") for k in range(1, 7))


def a_plate():
    places = np.array([[0.1 * k, 0.05 * (k % 2), 0.0] for k in range(6)])
    axes = np.tile(np.eye(3), (6, 1, 1))
    points = tuple(dof.point for dof in OUTPUTS)
    return Layout(("plate",), np.zeros((1, 3)), points, np.zeros(6, int), places, axes)


def a_pair(apart, *, noise, references=(0, 2), damping=0.006, turn=0.0, seed=1):
    """Modes at 20, 35, 35 (1 + apart) and 80 Hz; their campaign, and the FRFs of all points."""
    rng = np.random.default_rng(seed)
    freq = np.array([20.0, 35.0, 35.0 * (1 + apart), 80.0])
    zeta = np.array([0.01, 0.006, damping, 0.02])
    shapes = rng.normal(size=(6, 4)) / np.sqrt(5)
    shapes = shapes * np.exp(1j * turn * rng.normal(size=shapes.shape))
    poles = 2 * np.pi * freq * (-zeta + 1j * np.sqrt(1 - zeta**2))
    residues = np.einsum("om,im,m->oim", shapes, shapes, 1 / (2j * poles.imag))
    s = 2j * np.pi * FREQ[:, None]
    whole = np.tensordot(1 / (s - poles), residues, (1, 2))
    whole = whole + np.tensordot(1 / (s - poles.conj()), residues.conj(), (1, 2))
    whole = whole * (s**2)[:, :, None]
    tests = []
    for reference in references:
        clean = whole[:, :, reference : reference + 1]
        sd = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
        error = sd * rng.normal(size=(2, *clean.shape)) / np.sqrt(2)
        frf = Frf(FREQ, clean + error[0] + 1j * error[1], OUTPUTS, (OUTPUTS[reference],), QUANTITY)
        variance = np.broadcast_to(sd**2, clean.shape)
        estimate = FrfEstimate(frf, variance, "differences", np.ones((6, 1), bool))
        tests.append(Test(Condition("pair.uff", OUTPUTS[reference]), estimate))
    return Campaign("pair", a_plate(), tuple(tests)), whole


def full_matrix(campaign):
    model, identified, _ = identify(campaign)
    scaled = scale_shapes(model, campaign.layout)
    inside = np.arange(len(model.poles)) < identified.inside.sum()
    full = full_matrix_model(scaled, inside)
    return full.synthesise(campaign.freq_hz, QUANTITY).values, scaled, inside


def relative_error(values, truth):
    near = np.abs(FREQ - 35) < 1
    return np.linalg.norm((values - truth)[near]) / np.linalg.norm(truth[near])


@pytest.mark.parametrize(("apart", "seed"), [(0.0, 1), (3e-5, 2), (1.4e-4, 1), (1e-3, 2)])
def test_products_of_close_shapes_are_the_residues(apart, seed):
    campaign, truth = a_pair(apart, noise=0.001, seed=seed)
    values, scaled, inside = full_matrix(campaign)
    assert inside.sum() == 4
    assert scaled.has_scale
    assert relative_error(values, truth) < 0.01
    np.testing.assert_allclose(scaled.reciprocity[inside], 1.0, atol=1e-3)


def test_measured_columns_stay_as_they_were_fitted():
    campaign, _ = a_pair(1.4e-4, noise=0.002)
    model, _, measured = identify(campaign)
    before = model.synthesise(FREQ, QUANTITY).values
    after = scale_shapes(model).model.synthesise(FREQ, QUANTITY).values
    noise = np.sqrt(measured.variance.sum(axis=0))
    assert (np.linalg.norm(after - before, axis=0) < 0.3 * noise).all()


def test_complex_shapes_and_unequal_damping_are_separated_too():
    campaign, truth = a_pair(1e-4, noise=0.001, turn=0.05, damping=0.0072)
    assert relative_error(full_matrix(campaign)[0], truth) < 0.015


def test_three_references_determine_a_pair_better_than_two():
    campaign, truth = a_pair(0.0, noise=0.01, references=(0, 2, 4))
    assert relative_error(full_matrix(campaign)[0], truth) < 0.01


def test_modes_well_apart_are_no_group():
    model, _, _ = identify(a_pair(0.01, noise=0.001)[0])
    assert group_close_poles(model) == ()
    model, _, _ = identify(a_pair(1e-4, noise=0.001)[0])
    assert len(group_close_poles(model)) == 1


@pytest.mark.parametrize("rank", [2, 3])
def test_a_symmetric_matrix_is_its_factor_times_the_transpose(rank):
    rng = np.random.default_rng(rank)
    shapes = rng.normal(size=(3, rank)) + 1j * rng.normal(size=(3, rank))
    matrix = shapes @ shapes.T
    factor = factor_symmetric(matrix, rank)
    np.testing.assert_allclose(factor @ factor.T, matrix, atol=1e-12)
    real = shapes.real @ shapes.real.T
    assert np.abs(factor_symmetric(real, rank).imag).max() < 1e-7
