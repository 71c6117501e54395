"""Exact derivatives: columns against central differences, gradients against columns."""

from dataclasses import replace

import numpy as np
import pytest
from mbmodel_examples import channel_scale, mass_on_spring, mjcf, random_request, random_tree

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, linearise

FREQ = np.array([4.0, 17.0, 30.5, 44.0, 60.0, 81.0, 117.0, 160.0, 233.0])


def differences(model, theta, frf_request, step=2e-4):
    """Fourth-order central differences of the direct solve by the logarithm of each parameter.

    At relative steps h the truncation is about (h / 2 zeta)^4 / 30 of a resonance's derivative
    (zeta 0.5 to 5 %: below 1e-7 at the sharpest, which no line hits), the rounding 1e-14 / h of H.
    """
    evaluator = Evaluator(model, frf_request, direct=True)
    columns = []
    for k in range(len(theta)):

        def at(scale, k=k):
            moved = theta.copy()
            moved[k] *= 1 + scale * step
            return evaluator.at(moved).values

        columns.append((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step))
    return np.stack(columns, axis=-1)


def worst_column(columns, expected, values):
    """Worst parameter, relative to its column's largest value or 1e-4 of H, per channel's peak.

    Parameters that move no channel by 1e-4 of its peak have derivatives below the rounding of
    the differences, 1e-14 / 2e-4 = 5e-11 of H.
    """
    peak = channel_scale(values)[..., None]
    size = (np.abs(expected) / peak).max(axis=(0, 1, 2))
    error = (np.abs(columns - expected) / peak).max(axis=(0, 1, 2))
    return (error / np.maximum(size, 1e-4)).max()


def with_follower_forces(machine, seed=4):
    """Follower forces and gyroscopics beside the springs: neither K nor C is symmetric."""
    rng = np.random.default_rng(seed)
    model = as_drawn(machine)
    matrices = model.matrices(model.drawn)
    n = len(matrices.mass)

    def random_like(matrix):
        size = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        return size * rng.normal(size=(n, n)) * 0.02

    wheel = random_like(matrices.damping)
    return replace(
        machine,
        remaining_stiffness=random_like(matrices.stiffness),
        remaining_damping=wheel - wheel.T,
    )


CASES = {
    "accelerance": {},
    "mobility": {"quantity": "mobility"},
    "receptance": {"quantity": "receptance"},
    "window": {"window_tau": 0.2},
    "windowed receptance": {"window_tau": 0.2, "quantity": "receptance"},
}


@pytest.fixture(scope="module", params=CASES, ids=str)
def frf_request(request, station):
    return random_request(station, FREQ, n_out=4, n_in=2, seed=11, **CASES[request.param])


def test_columns_are_central_differences_for_all_72_parameters(station_model, away, frf_request):
    lines = linearise(station_model, away, frf_request)
    assert lines.solver.form is not None
    columns = lines.columns() * away
    assert columns.shape == (9, 4, 2, 72)
    expected = differences(station_model, away, frf_request)
    assert worst_column(columns, expected, lines.values) < 1e-6


def contract(lines, cotangent):
    """dJ = Re sum conj(W) dH."""
    return np.einsum("foi,foip->p", cotangent.conj(), lines.columns()).real


def assert_gradient_is_contraction(lines, seed=7):
    rng = np.random.default_rng(seed)
    shape = lines.values.shape
    # A weight per channel of its own size, as a cost has, so that every channel counts.
    scale = 1 / channel_scale(lines.values)
    cotangent = (rng.normal(size=shape) + 1j * rng.normal(size=shape)) * scale
    expected = contract(lines, cotangent)
    size = np.abs(np.einsum("foi,foip->foip", cotangent.conj(), lines.columns())).sum(
        axis=(0, 1, 2)
    )
    size[size == 0] = 1.0  # a parameter that moves nothing has no gradient either
    # Relative to the sum of sizes: the terms have random signs and cancel.
    assert (np.abs(lines.gradient(cotangent) - expected) / size).max() < 1e-10


@pytest.mark.parametrize("direct", [False, True])
def test_the_gradient_is_the_columns_times_the_cotangent(station_model, away, frf_request, direct):
    assert_gradient_is_contraction(Evaluator(station_model, frf_request, direct=direct).at(away))


@pytest.mark.parametrize("seed", range(5))
def test_the_gradient_of_a_skew_tree_is_the_columns_times_the_cotangent(from_text, seed):
    model = as_drawn(from_text(random_tree(seed)))
    frf_request = random_request(model.machine, np.linspace(1, 300, 20), n_out=3, n_in=2, seed=seed)
    assert_gradient_is_contraction(linearise(model, model.drawn, frf_request))


@pytest.mark.parametrize("case", ["accelerance", "receptance", "window"])
def test_columns_are_right_where_stiffness_and_damping_lack_symmetry(station, away, case):
    model = as_drawn(with_follower_forces(station))
    frf_request = random_request(station, FREQ, n_out=4, n_in=2, seed=11, **CASES[case])
    lines = linearise(model, away, frf_request)
    assert lines.solver.form is None
    expected = differences(model, away, frf_request)
    assert worst_column(lines.columns() * away, expected, lines.values) < 1e-6


@pytest.mark.parametrize("case", CASES)
def test_the_gradient_is_right_where_stiffness_and_damping_lack_symmetry(station, away, case):
    model = as_drawn(with_follower_forces(station))
    frf_request = random_request(station, FREQ, n_out=4, n_in=2, seed=11, **CASES[case])
    assert_gradient_is_contraction(linearise(model, away, frf_request))


def test_columns_of_a_gyroscopic_station_in_modal_form_are_right(station, away):
    machine = replace(with_follower_forces(station), remaining_stiffness=np.zeros((36, 36)))
    model = as_drawn(machine)
    frf_request = random_request(station, FREQ, n_out=4, n_in=2, seed=11)
    lines = linearise(model, away, frf_request)
    assert lines.solver.form is not None
    expected = differences(model, away, frf_request)
    assert worst_column(lines.columns() * away, expected, lines.values) < 1e-6
    assert_gradient_is_contraction(lines)


def test_modal_and_direct_columns_are_the_same(station_model, away):
    frf_request = random_request(station_model.machine, FREQ, n_out=4, n_in=2, seed=11)
    modal, direct = (
        Evaluator(station_model, frf_request, direct=direct).at(away) for direct in (False, True)
    )
    peak = channel_scale(direct.values)[..., None]
    error = np.abs(modal.columns() - direct.columns()) * away / peak
    # Two solves of 1e-10 each.
    assert error.max() < 1e-9


def test_one_spring_has_the_slope_of_its_closed_form(from_text):
    # dH/dk = -H^2 and dH/dc = -s H^2 for a receptance.
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0))))
    freq = np.array([0.0, 5.0, 13.7, 40.0])
    dof = (Dof.parse("acc1:+tz"),)
    lines = linearise(model, model.drawn, FrfRequest(freq, dof, dof, "receptance"))
    H = lines.values[:, 0, 0]
    expected = np.stack([-(H**2), -2j * np.pi * freq * H**2], axis=-1)
    np.testing.assert_allclose(lines.columns()[:, 0, 0], expected, rtol=1e-11)


def free_hinge():
    """A pendulum whose drive is free, under a stage on a spring."""
    inner = (
        '<body name="bob"><inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>'
        '<joint name="pivot" type="hinge" axis="0 1 0"/><site name="acc2" pos="0 0 -0.5"/></body>'
    )
    stage = mass_on_spring(4.0, 3e4, 11.0, axis="1 0 0").replace("</body>", inner + "</body>")
    return mjcf(stage, gravity="0 0 -9.81")


def test_a_joint_without_coefficients_has_no_columns(from_text):
    model = as_drawn(from_text(free_hinge()))
    outputs = tuple(map(Dof.parse, ["acc1:+tx", "acc2:-tx", "bob:+ry"]))
    frf_request = FrfRequest(np.array([0.2, 1.0, 13.0]), outputs, outputs[:2])
    lines = linearise(model, model.drawn, frf_request)
    assert lines.columns().shape == (3, 3, 2, 2)


def test_a_machine_with_a_free_joint_has_a_gradient(from_text):
    model = as_drawn(from_text(free_hinge()))
    outputs = tuple(map(Dof.parse, ["acc1:+tx", "acc2:-tx", "bob:+ry"]))
    frf_request = FrfRequest(np.array([0.2, 1.0, 13.0]), outputs, outputs[:2])
    assert_gradient_is_contraction(linearise(model, model.drawn, frf_request))
