"""Reduced state spaces against the whole ones: the error stays below the bound at every line."""

from dataclasses import replace

import control
import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf

from identification.words import Dof, UsageError
from mbmodel import FrfRequest, SystemMatrices, as_drawn, model_modes, state_space
from tuning.plant import reduce_system
from tuning.plant.reduction.truncation import split_stable_part

OUTPUTS = tuple(map(Dof.parse, ("hexapod:+tx", "hexapod:+rz", "acc1:+tz", "ty:+tx")))
INPUTS = tuple(map(Dof.parse, ("acc11:+tx", "ty:+tz")))
BAND = np.linspace(0.5, 200.0, 100)


def matrices(model, request):
    system = state_space(model, model.drawn, request)
    return SystemMatrices(system.A, system.B, system.C, system.D)


def lines_of(model):
    """Lines far beyond the band, and at the resonances, where errors are largest."""
    modes = model_modes(model, model.drawn).freq_hz
    return np.unique(np.concatenate([np.geomspace(1e-2, 1e5, 200), modes[modes > 0.1]]))


@pytest.fixture(scope="module")
def whole(station_model):
    request = FrfRequest(BAND, OUTPUTS, INPUTS, "receptance")
    return {
        quantity: matrices(station_model, replace(request, quantity=quantity))
        for quantity in ("receptance", "accelerance")
    }


@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
@pytest.mark.parametrize("method", ["balanced", "modal"])
def test_errors_of_the_station_stay_below_their_bound(station_model, whole, method, quantity):
    system = whole[quantity]
    laplace = 2j * np.pi * lines_of(station_model)
    expected = system.at(laplace)
    reduction = reduce_system(system, BAND, method)
    assert reduction.remainder.order == 0
    tight = []
    for order in (10, 20, 32, 46):
        reduced = reduction.at(reduction.terms_of(order))
        assert reduced.system.order in (order, order - 1)
        error = np.abs(reduced.system.at(laplace) - expected)
        assert (error <= reduced.bound * (1 + 1e-6)).all()
        tight.append(float((error / reduced.bound).max()))
    assert max(tight) > 0.05  # a bound that says something
    complete = reduction.at(len(reduction.sizes))
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(complete.system.at(laplace) - expected) < 1e-7 * scale).all()


def test_the_singular_values_are_those_of_python_control(whole):
    system = split_stable_part(whole["receptance"])[0]
    values = reduce_system(system, BAND, "balanced").sizes
    assert (np.diff(values) <= 0).all()
    random = np.random.default_rng(3)
    a = random.normal(size=(6, 6))
    a -= (np.linalg.eigvals(a).real.max() + 0.5) * np.eye(6)
    small = SystemMatrices(
        a, random.normal(size=(6, 1)), random.normal(size=(1, 6)), np.ones((1, 1))
    )
    reduction = reduce_system(small, BAND, "balanced")
    gramians = [control.lyap(m, n @ n.T) for m, n in ((a, small.b), (a.T, small.c.T))]
    hankel = np.sqrt(np.linalg.eigvals(gramians[0] @ gramians[1]).real)
    scaled = reduction.sizes * reduction.output_units[0] * reduction.input_units[0]
    # the product of two Gramians has lost half of the digits of small values
    np.testing.assert_allclose(scaled, np.sort(hankel)[::-1], rtol=1e-6, atol=1e-8 * scaled[0])


def test_a_lightly_damped_mode_has_the_singular_value_of_the_textbook(from_text):
    model = as_drawn(from_text(mjcf(mass_on_spring(2.0, 8e4, 0.4))))
    dof = (Dof.parse("a:+tz"),)
    system = matrices(model, FrfRequest(BAND, dof, dof, "receptance"))
    reduction = reduce_system(system, BAND, "balanced")
    zeta, omega = 0.4 / (2 * 2.0 * 200), 200.0
    # b = 1/m into q', c = 1 on q: |b| |c| / (4 zeta w) with the pair's residue 1 / (2 m w)
    expected = 1 / (2.0 * omega) / (4 * zeta * omega)
    sizes = reduction.sizes * reduction.output_units[0] * reduction.input_units[0]
    np.testing.assert_allclose(sizes, expected, rtol=2 * zeta)


def free_train(damping):
    """Three carriages in a row; the first has neither spring nor, maybe, damper to the floor."""
    inertial = '<inertial pos="0 0 0" mass="{}" diaginertia="1 1 1"/>'
    joint = '<joint name="{}" type="slide" axis="1 0 0" stiffness="{}" damping="{}"/>'
    return mjcf(
        f'<body name="first">{inertial.format(8)}{joint.format("f", 0, damping)}<site name="acc1"/>'
        f'<body name="second">{inertial.format(3)}{joint.format("s", 2e5, 8)}'
        f'<body name="third">{inertial.format(1)}{joint.format("t", 9e5, 6)}<site name="acc3"/>'
        "</body></body></body>"
    )


@pytest.mark.parametrize(("damping", "kept"), [(0.0, 2), (30.0, 1)])
@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_rigid_modes_stay(from_text, damping, kept, quantity):
    model = as_drawn(from_text(free_train(damping)))
    dofs = Dof.parse("acc3:+tx"), Dof.parse("acc1:+tx")
    system = matrices(model, FrfRequest(BAND, dofs, dofs[:1], quantity))
    laplace = 2j * np.pi * lines_of(model)
    expected = system.at(laplace)
    for method in ("balanced", "modal"):
        reduction = reduce_system(system, BAND, method)
        assert reduction.remainder.order == kept
        for terms in range(len(reduction.sizes) + 1):
            reduced = reduction.at(terms)
            error = np.abs(reduced.system.at(laplace) - expected)
            rounding = 1e-6 * np.abs(expected) + 1e-15 * np.abs(expected).max()
            assert (error <= reduced.bound * (1 + 1e-6) + rounding).all()
        with pytest.raises(UsageError, match=f"the {kept} states"):
            reduction.terms_of(kept - 1)


def test_an_unstable_mode_stays(from_text):
    text = mjcf(mass_on_spring(2.0, 8e4, 4.0) + mass_on_spring(1.0, 9e3, 2.0, name="b", node=2))
    model = as_drawn(from_text(text))
    dofs = tuple(map(Dof.parse, ("a:+tz", "b:+tz")))
    system = matrices(model, FrfRequest(BAND, dofs, dofs, "mobility"))
    a = system.a.copy()
    a[3, 3] += 5.0  # the damper of b drives
    unstable = replace(system, a=a)
    reduction = reduce_system(unstable, BAND, "balanced")
    assert reduction.remainder.order == 2
    poles = np.linalg.eigvals(reduction.at(0).system.a)
    np.testing.assert_allclose(poles.real, 1.5, rtol=1e-6)


def test_the_smallest_good_system_is_found(whole):
    reduction = reduce_system(whole["receptance"], BAND, "balanced")
    limit = 30 * float(reduction.sizes[-20:].sum())
    reduced = reduction.smallest(lambda candidate: candidate.scaled_bound <= limit)
    terms = reduction.terms_of(reduced.system.order)
    assert reduced.scaled_bound <= limit < reduction.at(terms - 1).scaled_bound
