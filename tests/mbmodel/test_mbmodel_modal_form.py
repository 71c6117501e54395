"""The modal evaluator against the direct solve, where it is easy and where it is not."""

from dataclasses import replace

import numpy as np
import pytest
from mbmodel_examples import (
    mass_on_spring,
    mjcf,
    random_request,
    random_tree,
    sensor_dofs,
    some_dofs,
    worst_of_channels,
)

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, linearise, modes_of_matrices
from mbmodel.assembly import Matrices
from mbmodel.frf.modal_form import modal_form
from mbmodel.frf.solver import Solver

# DESIGN: error of a fast FRF at most 1e-10. Relative to a channel's peak, as antiresonances are
# differences of modes.
AGREEMENT = 1e-10
QUANTITIES = ["receptance", "mobility", "accelerance"]


def against_direct(model, theta, frf_request):
    """Worst channel of the modal evaluator, and whether the modal form answered."""
    fast = Evaluator(model, frf_request).at(theta)
    exact = Evaluator(model, frf_request, direct=True).at(theta)
    assert exact.solver.form is None
    return worst_of_channels(fast.values, exact.values), fast.solver.form is not None


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_the_stations_modal_frfs_are_those_of_the_direct_solve(station_model, away, quantity):
    machine = station_model.machine
    hits = tuple(map(Dof.parse, ["acc11:+tx", "acc11:-tz", "acc17:+ty"]))
    freq = np.linspace(0.0, 250.0, 126)
    frf_request = FrfRequest(freq, sensor_dofs(machine), hits, quantity)
    error, modal = against_direct(station_model, away, frf_request)
    assert modal
    assert error < AGREEMENT


def test_a_windowed_answer_is_that_of_the_direct_solve(station_model, away):
    frf_request = random_request(station_model.machine, np.linspace(0, 250, 51), window_tau=0.3)
    error, modal = against_direct(station_model, away, frf_request)
    assert modal
    assert error < AGREEMENT


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_an_overdamped_station_is_answered_as_by_the_direct_solve(station_model, quantity):
    theta = station_model.drawn.copy()
    theta[[p.name.endswith("damping") for p in station_model.parameters]] *= 60
    poles = modes_of_matrices(station_model.matrices(theta)).poles
    assert (poles.imag == 0).sum() >= 10
    frf_request = random_request(station_model.machine, np.linspace(0, 250, 51), quantity=quantity)
    # Whether the modal form is exact enough here (2e-10 of a coordinate's peak) is the evaluator's
    # to decide; the answer is right either way.
    error, _ = against_direct(station_model, theta, frf_request)
    assert error < AGREEMENT


@pytest.mark.parametrize("seed", range(20))
def test_a_skew_tree_is_answered_as_by_the_direct_solve(from_text, seed):
    model = as_drawn(from_text(random_tree(seed)))
    frf_request = random_request(
        model.machine, np.linspace(0.5, 400, 60), n_out=7, n_in=3, seed=seed
    )
    error, _ = against_direct(model, model.drawn, frf_request)
    assert error < AGREEMENT


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("direct", [False, True])
def test_a_skew_tree_is_reciprocal(from_text, seed, direct):
    # Maxwell-Betti: K, C and M are symmetric, so H_ij = H_ji whatever the labels.
    model = as_drawn(from_text(random_tree(seed)))
    dofs = some_dofs(model.machine, 5, seed)
    frf_request = FrfRequest(np.linspace(0.5, 400, 30), dofs, dofs)
    H = Evaluator(model, frf_request, direct=direct).at(model.drawn).values
    assert worst_of_channels(H.transpose(0, 2, 1), H) < AGREEMENT


def test_a_gyroscopic_station_is_not_reciprocal_but_right(station_model):
    machine = station_model.machine
    gyroscopic = np.zeros((36, 36))
    rx, ry = (machine.coordinates.index(f"spindle_{name}") for name in ("rx", "ry"))
    gyroscopic[rx, ry], gyroscopic[ry, rx] = 8e4, -8e4
    model = as_drawn(replace(machine, remaining_damping=gyroscopic))
    dofs = tuple(map(Dof.parse, ["acc21:+tx", "acc22:+tz", "acc5:-ty"]))
    frf_request = FrfRequest(np.linspace(1, 250, 50), dofs, dofs)
    error, modal = against_direct(model, model.drawn, frf_request)
    assert modal
    assert error < AGREEMENT
    H = linearise(model, model.drawn, frf_request).values
    assert worst_of_channels(H.transpose(0, 2, 1), H) > 1e-3


def test_unsymmetric_stiffness_has_no_modal_form_and_is_solved_directly(station_model):
    machine = station_model.machine
    follower = np.zeros((36, 36))
    follower[3, 7] = 1e8
    model = as_drawn(replace(machine, remaining_stiffness=follower))
    assert modal_form(model.matrices(model.drawn)) is None
    dofs = some_dofs(machine, 4, 3)
    frf_request = FrfRequest(np.linspace(1, 250, 20), dofs, dofs[:2])
    lines = linearise(model, model.drawn, frf_request)
    assert lines.solver.form is None
    rows = machine.layout.rows(dofs) @ machine.jacobian
    matrices = model.matrices(model.drawn)
    for k, s in enumerate(2j * np.pi * frf_request.freq_hz):
        exact = s**2 * rows @ np.linalg.solve(matrices.dynamic_stiffness(s), rows[:2].T)
        np.testing.assert_allclose(lines.values[k], exact, rtol=1e-9, atol=1e-18)


def critical(mass, stiffness):
    return 2 * np.sqrt(mass * stiffness)


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("factor", [1.0, 1 - 1e-15, 1 + 1e-15, 1 - 1e-12, 1 + 1e-12, 1 + 1e-9])
def test_a_critically_damped_mass_is_right(from_text, quantity, factor):
    # A double pole has one eigenvector: no modal form. Beside it the eigenvectors are dependent.
    mass, k = 4.0, 9e6
    c = critical(mass, k) * factor
    model = as_drawn(from_text(mjcf(mass_on_spring(mass, k, c))))
    freq = np.linspace(0.0, 600.0, 61)
    dof = (Dof.parse("acc1:+tz"),)
    H = linearise(model, model.drawn, FrfRequest(freq, dof, dof, quantity)).values
    s = 2j * np.pi * freq
    power = QUANTITIES.index(quantity)
    expected = s**power / (mass * s**2 + c * s + k)
    assert worst_of_channels(H[:, 0, 0], expected) < 1e-9


@pytest.mark.parametrize("factor", [1.0, 1 + 9e-16])
def test_a_critically_damped_mass_beside_a_soft_one_is_right(from_text, factor):
    # The soft mass moves most in every line, and its pole is the sharpest: a check of the largest
    # motion, or near the sharpest pole, does not see the stiff mass's double pole.
    k, m = 188185.2209250379, 6.12
    c = critical(m, k) * factor
    stiff = mass_on_spring(m, k, c, name="b", node=2, axis="1 0 0", pos="1 0 0")
    soft = mass_on_spring(2, 2906.525360730613, 0.54, axis="1 0 0")
    model = as_drawn(from_text(mjcf(soft + stiff)))
    freq = np.linspace(0, 42, 301)
    dofs = tuple(map(Dof.parse, ["acc1:+tx", "acc2:+tx"]))
    H = linearise(model, model.drawn, FrfRequest(freq, dofs, dofs)).values
    s = 2j * np.pi * freq
    expected = s**2 / (m * s**2 + c * s + k)
    assert worst_of_channels(H[:, 1, 1], expected) < 1e-9


def test_an_undamped_machine_is_right_between_its_poles(from_text):
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 0.0))))
    freq = np.array([0.0, 5.0, 13.0, 14.5, 40.0])
    dof = (Dof.parse("acc1:+tz"),)
    H = linearise(model, model.drawn, FrfRequest(freq, dof, dof, "receptance")).values[:, 0, 0]
    np.testing.assert_allclose(H, 1 / (3e4 - 4 * (2 * np.pi * freq) ** 2), rtol=1e-12)


def test_modal_shapes_of_the_transpose_swap_rows_and_columns(station_model):
    form = modal_form(station_model.matrices(station_model.drawn))
    np.testing.assert_array_equal(form.transposed.rows, form.columns.T)
    np.testing.assert_array_equal(form.transposed.columns, form.rows.T)
    assert (form.poles.imag >= 0).all()
    assert (form.poles.real < 0).all()


def test_a_machine_with_two_equal_modes_is_right(from_text):
    # Semisimple double poles: any pair of independent shapes serves.
    first = mass_on_spring(4.0, 3e4, 11.0, name="a", node=1)
    second = mass_on_spring(4.0, 3e4, 11.0, name="b", node=2, pos="2 0 0")
    model = as_drawn(from_text(mjcf(first + second)))
    dofs = tuple(map(Dof.parse, ["acc1:+tz", "acc2:+tz"]))
    error, modal = against_direct(
        model, model.drawn, FrfRequest(np.linspace(0, 30, 31), dofs, dofs, "receptance")
    )
    assert modal
    assert error < AGREEMENT


@pytest.mark.parametrize("transposed", [False, True])
def test_parts_that_nothing_couples_are_eliminated_apart(transposed):
    rng = np.random.default_rng(5)
    order = rng.permutation(5)
    mass, damping, stiffness = (np.zeros((5, 5)) for _ in range(3))
    for span, matrix in ((slice(0, 2), mass), (slice(2, 5), mass)):
        count = span.stop - span.start
        matrix[span, span] = np.eye(count) + 0.1 * rng.standard_normal((count, count))
        stiffness[span, span] = 100 * np.eye(count) + rng.standard_normal((count, count))
        damping[span, span] = rng.standard_normal((count, count))
    mass, damping, stiffness = (m[np.ix_(order, order)] for m in (mass, damping, stiffness))
    laplace, force = 1j * np.linspace(1.0, 30.0, 7), rng.standard_normal((5, 2, 1))
    solver = Solver(Matrices(mass, damping, stiffness), laplace, None)
    s = laplace[:, None, None]
    whole = s**2 * mass + s * damping + stiffness
    whole = whole.swapaxes(1, 2) if transposed else whole
    expected = np.linalg.solve(whole, np.broadcast_to(force[..., 0], (7, 5, 2))).transpose(1, 2, 0)
    np.testing.assert_allclose(
        solver.solve(force, transposed=transposed), expected, rtol=1e-10, atol=1e-14
    )
