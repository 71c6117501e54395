"""Poles against closed forms and against the eigenvalues of the state space."""

import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, random_tree

from identification.words import Dof
from mbmodel import FrfRequest, Modes, as_drawn, modes_of_matrices, state_space


def modes_of(machine):
    model = as_drawn(machine)
    return modes_of_matrices(model.matrices(model.drawn))


def test_one_mass_has_the_pole_of_the_closed_form(from_text):
    mass, k, c = 4.0, 3e4, 11.0
    modes = modes_of(from_text(mjcf(mass_on_spring(mass, k, c))))
    expected = -c / (2 * mass) + 1j * np.sqrt(k / mass - (c / (2 * mass)) ** 2)
    np.testing.assert_allclose(modes.poles, [expected], rtol=1e-13)


def test_frequency_and_damping_ratio_are_those_of_the_undamped_mass(from_text):
    mass, k, c = 4.0, 3e4, 11.0
    modes = modes_of(from_text(mjcf(mass_on_spring(mass, k, c))))
    # seed, eq. 3.4: |s| = w0 and -Re s / |s| = zeta, whatever the damping.
    np.testing.assert_allclose(modes.freq_hz, [np.sqrt(k / mass) / (2 * np.pi)], rtol=1e-13)
    np.testing.assert_allclose(modes.damping, [c / (2 * np.sqrt(k * mass))], rtol=1e-12)


def test_an_overdamped_mass_has_two_real_poles(from_text):
    mass, k, c = 4.0, 3e4, 4e3
    modes = modes_of(from_text(mjcf(mass_on_spring(mass, k, c))))
    np.testing.assert_allclose(modes.poles, np.sort(np.roots([mass, c, k]))[::-1], rtol=1e-12)
    np.testing.assert_allclose(modes.damping, [1, 1])


def test_an_undamped_mass_has_no_damping(from_text):
    modes = modes_of(from_text(mjcf(mass_on_spring(4.0, 3e4, 0))))
    np.testing.assert_allclose(modes.damping, [0], atol=1e-15)


def test_modes_are_listed_by_rising_frequency(station_model, away):
    assert (np.diff(modes_of_matrices(station_model.matrices(away)).freq_hz) >= 0).all()


def test_the_station_has_one_oscillation_for_each_coordinate(station_model):
    modes = modes_of_matrices(station_model.matrices(station_model.drawn))
    assert (modes.poles.imag > 0).sum() + (modes.poles.imag == 0).sum() / 2 == 36


def test_the_stations_poles_are_the_eigenvalues_of_its_state_space(station_model, away):
    dof = (Dof.parse("ty:+tx"),)
    A = state_space(station_model, away, FrfRequest(np.ones(1), dof, dof)).A
    eigenvalues = np.linalg.eigvals(A)
    expected = eigenvalues[eigenvalues.imag >= 0]
    expected = expected[np.argsort(np.abs(expected))]
    # A is not balanced, its entries span 1e10: some digits go.
    np.testing.assert_allclose(
        modes_of_matrices(station_model.matrices(away)).poles, expected, rtol=1e-9
    )


@pytest.mark.parametrize("seed", range(6))
def test_every_pole_of_a_skew_tree_makes_its_dynamic_stiffness_singular(from_text, seed):
    model = as_drawn(from_text(random_tree(seed)))
    matrices = model.matrices(model.drawn)
    for pole in modes_of_matrices(matrices).poles:
        Z = matrices.dynamic_stiffness(pole)
        scale = np.sqrt(np.diag(matrices.stiffness))
        values = np.linalg.svd(Z / np.outer(scale, scale), compute_uv=False)
        assert values[-1] < 1e-9 * max(values[0], 1)


def test_a_free_pair_keeps_its_rigid_motion_at_zero(from_text):
    upper = mass_on_spring(3.0, 9e4, 15.0, name="b", node=2)
    free = mass_on_spring(7.0, 0, 0).replace("</body>", upper + "</body>")
    modes = modes_of(from_text(mjcf(free)))
    expected = np.sqrt(9e4 * (1 / 3 + 1 / 7)) / (2 * np.pi)
    assert modes.freq_hz[-1] == pytest.approx(expected, rel=1e-12)
    np.testing.assert_array_equal(modes.poles[:-1], [0])


def test_a_pole_at_rest_has_no_damping_ratio_but_zero():
    modes = Modes(np.array([0j, -2 + 0j]), np.eye(2).astype(complex), ("", ""))
    np.testing.assert_array_equal(modes.damping, [0, 1])
