"""Exact derivatives of poles and shapes: closed form, central differences, all kinds of Parts."""

from dataclasses import replace

import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, random_tree, some_dofs
from test_mbmodel_parts import off, size_of, sprung_pendulum
from test_mbmodel_slopes import with_follower_forces

from identification.words import Dof, UsageError
from mbmodel import (
    ModeEvaluator,
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    modes_of_matrices,
    sensor_parts,
    spring_parts,
)
from mbmodel.modes.sensitivities import _solve_bordered

FAMILIES = {
    "springs": lambda machine: (),
    "bodies": body_parts,
    "joints": joint_parts,
    "sensors": sensor_parts,
}


@pytest.fixture(scope="module", params=["station", "skew", "pendulum"])
def machine(request, station, from_text):
    if request.param == "station":
        return station
    return from_text(random_tree(4, n_body=3) if request.param == "skew" else sprung_pendulum())


class Costs:
    """One cost a mode, of its pole and of the direction of its shape: modes in a fixed order."""

    def __init__(self, model, theta, n_out=7, seed=2):
        self.evaluator = ModeEvaluator(model, some_dofs(model.machine, n_out, seed))
        rng = np.random.default_rng(seed)
        self.start = self.evaluator.at(theta)
        self.chosen = np.flatnonzero(self.start.modes.poles.imag > 0)
        shape = (n_out, len(self.chosen))
        # Channels are translations and rotations: each is measured by its own largest motion.
        size = np.abs(self.start.shapes).max(axis=1)[:, None]
        self.size = np.where(size > 1e-9 * size.max(), size, size.max())
        self.reference = rng.normal(size=shape) + 1j * rng.normal(size=shape)
        self.weight = rng.normal(size=shape[1]) + 1j * rng.normal(size=shape[1])

    def values(self, theta):
        """Re (g* log s) - log of MAC, mode by mode; modes keep the numbers of the start."""
        now = self.evaluator.at(theta)
        poles = now.modes.poles
        near = np.abs(poles - self.start.modes.poles[self.chosen, None]).argmin(axis=1)
        assert len(set(near)) == len(near)
        shapes = now.shapes[:, near] / self.size
        product = (self.reference.conj() * shapes).sum(axis=0)
        square = (np.abs(shapes) ** 2).sum(axis=0)
        pole = (self.weight.conj() * np.log(poles[near])).real
        return pole + np.log(np.abs(product) ** 2 / square)

    def gradient(self, modes_chosen=None):
        """Of the sum over the chosen ones."""
        picked = np.arange(len(self.chosen)) if modes_chosen is None else modes_chosen
        now, chosen = self.start, self.chosen[picked]
        shapes, reference = now.shapes[:, chosen] / self.size, self.reference[:, picked]
        product = (reference.conj() * shapes).sum(axis=0)
        square = (np.abs(shapes) ** 2).sum(axis=0)
        by_shapes = 2 * (reference / product.conj() - shapes / square) / self.size
        by_poles = self.weight[picked] / now.modes.poles[chosen].conj()
        return now.gradient(chosen, by_poles, by_shapes)


def quotients(costs, theta, sizes, step=2e-4):
    """Fourth-order central differences; (n_mode, n_parameter)."""
    columns = []
    for k, size in enumerate(sizes):

        def at(scale, k=k, size=size):
            moved = theta.copy()
            moved[k] += scale * step * size
            return costs.values(moved)

        columns.append((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step))
    return np.stack(columns, axis=-1)


def worst(costs, theta, model, *, step=2e-4):
    """Largest error of any mode's derivative, relative to the largest of its mode."""
    sizes = np.array([size_of(parameter) for parameter in model.parameters])
    expected = quotients(costs, theta, sizes, step)
    gradients = np.array([costs.gradient([k]) * sizes for k in range(len(costs.chosen))])
    return (np.abs(gradients - expected).max(axis=1) / np.abs(expected).max(axis=1)).max()


def test_one_mass_has_the_slopes_of_its_closed_form(from_text):
    # m s^2 + c s + k = 0: ds/dk = -1 / (2 m s + c), ds/dc = -s / (2 m s + c).
    mass, k, c = 4.0, 3e4, 11.0
    model = as_drawn(from_text(mjcf(mass_on_spring(mass, k, c))))
    now = ModeEvaluator(model, [Dof.parse("acc1:+tz")]).at(model.drawn)
    s = now.modes.poles[0]
    for h in (1.0, 1j):
        gradient = now.gradient(np.array([0]), np.array([h]), np.zeros((1, 1), complex))
        expected = (np.conj(h) * np.array([-1, -s]) / (2 * mass * s + c)).real
        np.testing.assert_allclose(gradient, expected, rtol=1e-12, atol=1e-12 * abs(expected).max())


@pytest.mark.parametrize("family", FAMILIES)
def test_derivatives_are_central_differences_for_every_kind_of_part(machine, family):
    # Modes of the examples lie at least 0.5 % apart, so that differences of 2e-4 stay clear.
    model = Model(machine, (*spring_parts(machine), *FAMILIES[family](machine)))
    theta = off(model, amount=0.3)
    assert worst(Costs(model, theta), theta, model) < 1e-6


def test_all_modes_together_have_the_sum_of_their_gradients(station_model, away):
    costs = Costs(station_model, away)
    single = sum(costs.gradient([k]) for k in range(len(costs.chosen)))
    np.testing.assert_allclose(
        costs.gradient() * away, single * away, rtol=0, atol=1e-11 * np.abs(single * away).max()
    )


def test_derivatives_hold_where_stiffness_and_damping_lack_symmetry(station, away):
    model = as_drawn(with_follower_forces(station))
    assert worst(Costs(model, away), away, model) < 1e-6


def test_rotors_are_in_the_derivatives(station, away):
    model = as_drawn(replace(with_follower_forces(station), remaining_stiffness=np.zeros((36, 36))))
    assert worst(Costs(model, away), away, model) < 1e-6


def equal_masses(split):
    """Two masses side by side on springs of their own, all but equal."""
    first = mass_on_spring(4.0, 3e4, 11.0, name="a", node=1)
    return mjcf(first + mass_on_spring(4.0, 3e4 * (1 + split), 11.0, name="b", node=2, pos="1 0 0"))


@pytest.mark.parametrize("split", [0.0, 1e-12, 1e-5])
def test_poles_that_coincide_leave_the_gradient_finite(from_text, split):
    model = as_drawn(from_text(equal_masses(split)))
    outputs = [Dof.parse("acc1:+tz"), Dof.parse("acc2:+tz")]
    now = ModeEvaluator(model, outputs).at(model.drawn)
    rng = np.random.default_rng(3)
    reference = rng.normal(size=(2, 2)) + 0j
    product = (reference.conj() * now.shapes).sum(axis=0)
    by_shapes = reference / product.conj() - now.shapes / (np.abs(now.shapes) ** 2).sum(axis=0)
    gradient = now.gradient(np.arange(2), 1 / now.modes.poles.conj(), by_shapes)
    assert np.isfinite(gradient).all()
    # The masses do not feel each other: d log s / dk = -1 / (s (2 m s + c)) for each.
    s = now.modes.poles
    expected = (-1 / (s * (2 * 4.0 * s + 11.0))).real
    np.testing.assert_allclose(np.sort(gradient[[0, 2]]), np.sort(expected), rtol=1e-4)


def test_an_equation_without_solution_is_answered_by_its_shortest_least_squares():
    matrix = np.array([[[1.0, 0], [0, 1e-9]]], complex)
    solution = _solve_bordered(matrix, np.ones((1, 2), complex), np.array([True]))
    np.testing.assert_allclose(solution, [[1, 0]], atol=1e-12)


def test_a_motion_at_rest_is_refused(from_text):
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 0, 11.0))))
    now = ModeEvaluator(model, [Dof.parse("acc1:+tz")]).at(model.drawn)
    with pytest.raises(UsageError, match="at rest"):
        now.gradient(np.array([0]), np.ones(1, complex), np.zeros((1, 1), complex))


def test_a_free_machine_has_derivatives_of_its_elastic_modes(from_text):
    upper = mass_on_spring(3.0, 9e4, 15.0, name="b", node=2)
    free = mass_on_spring(7.0, 0, 0).replace("</body>", upper + "</body>")
    model = as_drawn(from_text(mjcf(free)))
    now = ModeEvaluator(model, [Dof.parse("acc1:+tz"), Dof.parse("acc2:+tz")]).at(model.drawn)
    last = np.array([len(now.modes.poles) - 1])
    s, mass = now.modes.poles[last[0]], 1 / (1 / 3 + 1 / 7)
    gradient = now.gradient(last, 1 / s.conj()[None], np.zeros((2, 1), complex))
    expected = (np.array([-1, -s]) / (s * (2 * mass * s + 15.0))).real
    np.testing.assert_allclose(gradient, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_modes_are_those_of_the_model(station_model, away):
    now = ModeEvaluator(station_model, [Dof.parse("acc1:+tz")]).at(away)
    np.testing.assert_array_equal(
        now.modes.poles, modes_of_matrices(station_model.matrices(away)).poles
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_slopes_of_all_poles_at_once_are_those_one_by_one(machine, family):
    model = Model(machine, (*spring_parts(machine), *FAMILIES[family](machine)))
    linearised = ModeEvaluator(model, some_dofs(machine, 3, 1)).at(model.drawn)
    chosen = np.flatnonzero(linearised.modes.poles.imag > 0)[:6]
    by_mode = np.stack([linearised._pole_slope(number) for number in chosen.tolist()], axis=1)
    found = linearised.pole_slopes(chosen)
    np.testing.assert_allclose(found, by_mode, atol=1e-9 * np.abs(by_mode).max())
