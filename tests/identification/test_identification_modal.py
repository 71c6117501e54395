"""From FRFs to modes: the polynomials, the refinement and the automatic selection."""

import numpy as np
import pytest
import scipy.linalg
from modal_case import found_and_extra, modal_case

from identification.modal import (
    WeightedFrfs,
    auto_mac,
    cmif,
    comac,
    identify_modes,
    lscf,
    mac,
    mmif,
    mpc,
    mpd,
)
from identification.modal.refinement import (
    _apply_step,
    _free_parameters,
    _schur_complement,
    refine,
)
from identification.modal.shape_fit import cost_rise_without, fit_shapes_with_sums
from identification.words import Dof, ModalModel, UsageError

SMALL = {"total": 6, "n_out": 7, "n_in": 2, "lines": 401}


def data_of(case, *, full=False):
    s = 2j * np.pi * case.freq_hz
    if full:
        ramp = np.linspace(1, 3, len(s))[:, None, None] * np.ones_like(case.sd)
        return WeightedFrfs(s, 2, case.noisy, ramp / case.sd**2, np.ones_like(case.sd))
    return WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), 1 / case.sd**2)


def start_of(case, count, *, off=0.0):
    rng = np.random.default_rng(1)
    poles = case.poles[:count] * (1 + off * rng.normal(size=count))
    return poles, case.shapes[case.drives][:, :count] * (1 + off * rng.normal(size=count))


def test_poles_are_those_of_the_least_squares_problem_written_out():
    case = modal_case(5, 3, **SMALL)
    order, n_in = 6, 2
    step = 1 / (2 * case.freq_hz[-1])
    powers = np.exp(-2j * np.pi * case.freq_hz * step)[:, None] ** np.arange(order + 1)
    real = np.vstack([powers.real, powers.imag])
    total = np.zeros(((order + 1) * n_in,) * 2)
    for out in range(7):
        product = (powers[:, :, None] * case.noisy[:, out, None, :]).reshape(len(powers), -1)
        both = np.vstack([product.real, product.imag])
        left = both - real @ np.linalg.lstsq(real, both, rcond=None)[0]
        total += left.T @ left
    size = order * n_in
    free = -np.linalg.solve(total[:size, :size], total[:size, size:])
    blocks = [free[k * n_in : (k + 1) * n_in] for k in range(order)] + [np.eye(n_in)]

    def determinant(pole):
        y = np.exp(-pole * step)
        matrix = sum(block * y**k for k, block in enumerate(blocks))
        return np.linalg.svd(matrix, compute_uv=False)[-1] / np.linalg.norm(matrix)

    found = lscf(case.freq_hz, case.noisy, order)[-1]
    assert len(found.poles) >= 3
    for pole, row in zip(found.poles, found.participation.T, strict=True):
        assert determinant(pole) < 1e-8
        y = np.exp(-pole * step)
        matrix = sum(block * y**k for k, block in enumerate(blocks))
        assert np.linalg.norm(row @ matrix) < 1e-7 * np.linalg.norm(matrix)


def test_orders_found_together_are_those_found_alone():
    case = modal_case(6, 3, **SMALL)
    together = lscf(case.freq_hz, case.noisy, 12)
    for order in (2, 7):
        alone = lscf(case.freq_hz, case.noisy, order)[-1]
        np.testing.assert_allclose(
            np.sort_complex(together[order - 1].poles), np.sort_complex(alone.poles), rtol=1e-6
        )


def test_too_few_lines_for_the_order_are_refused():
    case = modal_case(5, 3, **SMALL)
    with pytest.raises(UsageError, match="use at most order"):
        lscf(case.freq_hz[:20], case.noisy[:20], 12)


@pytest.mark.parametrize("full", [False, True])
def test_a_clean_machine_is_recovered_to_rounding(full):
    case = modal_case(7, 4, noise=1e-9, **{**SMALL, "total": 4})
    data = data_of(case, full=full)
    found, _ = refine(data, *start_of(case, 4, off=1e-3))
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(case.poles), rtol=1e-7)
    np.testing.assert_allclose(found.values(data.laplace, 2), case.clean, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("full", [False, True])
def test_the_normal_matrix_is_that_of_the_jacobian_written_out(full):
    case = modal_case(8, 3, **{**SMALL, "total": 3, "lines": 101, "start": 5})
    data = data_of(case, full=full)
    fitted, linear = fit_shapes_with_sums(data, *start_of(case, 3, off=0.02))
    every = np.ones(3, bool)
    free = _free_parameters(data, fitted.participation, every, every)
    matrix, right = _schur_complement(data, fitted, linear, free)
    weight = np.sqrt(data.weights * data.cells)

    def residual(step):
        moved, _ = fit_shapes_with_sums(data, *_apply_step(fitted, step, free))
        error = ((data.values - moved.values(data.laplace, 2)) * weight).ravel()
        return np.concatenate([error.real, error.imag])

    # The derivative of the projected residual differs from the Jacobian with shapes eliminated
    # (Kaufman) by a part normal to it and of the size of the residual: compare the gradients.
    size = len(right)
    h = 1e-6 * np.concatenate(
        [np.abs(fitted.poles), np.abs(fitted.poles), np.ones(2 * len(free.inputs))]
    )
    slope = np.array(
        [
            (np.sum(residual(step) ** 2) - np.sum(residual(-step) ** 2)) / (2 * h[k])
            for k, step in enumerate(np.diag(h))
        ]
    )
    np.testing.assert_allclose(-2 * right, slope, atol=2e-5 * np.abs(slope).max())
    assert matrix.shape == (size, size)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
    assert scipy.linalg.eigvalsh(matrix).min() > 0


def test_leaving_a_mode_out_costs_what_a_fit_without_it_says():
    case = modal_case(9, 4, **SMALL)
    data = data_of(case)
    fitted, _ = refine(data, *start_of(case, 4))
    rise = cost_rise_without(data, fitted)
    for mode in range(4):
        others = np.arange(4) != mode
        without, _ = fit_shapes_with_sums(
            data, fitted.poles[others], fitted.participation[:, others]
        )
        assert rise[mode] == pytest.approx(without.cost - fitted.cost, rel=1e-6)


@pytest.mark.parametrize(
    ("seed", "count", "least", "highest"), [(24, 24, 24, 0.037), (36, 36, 34, 0.059)]
)
def test_all_modes_are_found_without_a_click(seed, count, least, highest):
    case = modal_case(seed, count, highest_damping=highest)
    found = identify_modes(data_of(case), case.freq_hz)
    hits, extra = found_and_extra(
        case, found.fit.freq_hz[found.inside], found.fit.damping[found.inside]
    )
    assert hits >= least
    assert extra <= 1
    values = found.fit.values(2j * np.pi * case.freq_hz, 2)
    error = np.sqrt((np.abs(values - case.clean) ** 2).mean(axis=0))
    assert np.sqrt(((error / (case.sd / 0.01)) ** 2).mean()) < 0.01
    assert found.misfit == pytest.approx(1.0, abs=0.1)


def test_two_close_modes_stay_apart():
    case = modal_case(
        3,
        5,
        total=7,
        n_out=30,
        modes_hz=[125.0, 125.4],
        damping=[0.001, 0.005],
        lines=1601,
        start=40,
    )
    found = identify_modes(data_of(case), case.freq_hz)
    inside = found.fit.freq_hz[found.inside]
    for mode in (125.0, 125.4):
        assert np.abs(inside - mode).min() < 0.02
    assert found_and_extra(case, inside, found.fit.damping[found.inside]) == (5, 0)


def test_a_roving_hammer_finds_what_roving_sensors_find():
    # 77 hits, 3 fixed accelerometers, 13 lightly damped modes, two of them 0.4 Hz apart.
    rng = np.random.default_rng(2)
    close = {
        "modes_hz": [*np.linspace(15, 185, 11) + rng.uniform(-3, 3, 11), 125.2, 125.6],
        "damping": rng.uniform(0.0005, 0.009, 13),
    }
    case = modal_case(3, 13, total=15, n_out=77, lines=1601, start=40, **close)
    exchanged = WeightedFrfs(
        2j * np.pi * case.freq_hz,
        2,
        case.noisy.transpose(0, 2, 1),
        np.ones((len(case.freq_hz), 1, 1)),
        1 / case.sd.T**2,
    )
    found = identify_modes(exchanged, case.freq_hz)
    fit = found.fit
    assert found_and_extra(case, fit.freq_hz[found.inside], fit.damping[found.inside]) == (13, 0)
    assert fit.shapes.shape[0] == 3
    values = fit.values(2j * np.pi * case.freq_hz, 2)
    error = np.linalg.norm(values - case.clean.transpose(0, 2, 1)) / np.linalg.norm(case.clean)
    assert error < 0.01


def test_standard_deviations_are_those_of_repetitions():
    # 40 repetitions of 4 modes: the pulls' rms is within 1 +- 4 / sqrt(2 * 160) = 0.78..1.22.
    pulls = []
    for seed in range(40):
        case = modal_case(seed, 4, **{**SMALL, "total": 4, "lines": 201, "start": 10})
        found, matrix = refine(data_of(case), *start_of(case, 4))
        covariance = np.linalg.inv(matrix) / 2
        sd = np.sqrt(np.diag(covariance))
        pulls += [
            *((found.poles.real - case.poles.real) / sd[:4]),
            *((found.poles.imag - case.poles.imag) / sd[4:8]),
        ]
    assert 0.78 < np.sqrt(np.mean(np.square(pulls))) < 1.22


def test_the_cmif_is_the_squared_singular_values():
    values = modal_case(5, 3, **SMALL).clean[:5]
    expected = np.linalg.eigvalsh(values.conj().transpose(0, 2, 1) @ values)[:, ::-1]
    np.testing.assert_allclose(cmif(values), expected, atol=1e-12 * expected.max())


def test_the_mmif_drops_at_a_resonance_of_a_real_mode():
    freq = np.linspace(10, 50, 401)
    s = 2j * np.pi * freq[:, None, None]
    omega = 2 * np.pi * 30
    shape = np.array([1.0, -2.0, 0.5])
    values = (
        s**2
        * np.multiply.outer(np.ones(1), np.outer(shape, shape[:1]))
        / (s**2 + 2 * 0.01 * omega * s + omega**2)
    )
    found = mmif(values + 1e-6 * np.random.default_rng(0).normal(size=values.shape))
    assert freq[np.argmin(found[:, 0])] == pytest.approx(30, abs=0.05)
    assert found[:, 0].min() < 0.01
    assert ((found >= -1e-9) & (found <= 1 + 1e-9)).all()


def test_mac_tells_shapes_apart_whatever_their_scale():
    rng = np.random.default_rng(4)
    shapes = np.linalg.qr(rng.normal(size=(6, 3)) + 1j * rng.normal(size=(6, 3)))[0]
    np.testing.assert_allclose(auto_mac(shapes), np.eye(3), atol=1e-14)
    np.testing.assert_allclose(np.diag(mac(shapes, (2 - 3j) * shapes)), 1.0)


def test_comac_points_at_the_sensor_that_differs():
    rng = np.random.default_rng(4)
    shapes = rng.normal(size=(6, 5))
    other = shapes.copy()
    other[2] = rng.normal(size=5)
    found = comac(shapes, other)
    assert np.argmin(found) == 2
    np.testing.assert_allclose(np.delete(found, 2), 1.0)


def test_real_shapes_are_collinear_whatever_their_phase():
    rng = np.random.default_rng(4)
    real = rng.normal(size=(9, 2)) * np.exp(0.7j)
    np.testing.assert_allclose(mpc(real), 1.0)
    np.testing.assert_allclose(mpd(real), 0.0, atol=1e-7)
    circle = np.exp(2j * np.pi * np.arange(8) / 8)[:, None]
    np.testing.assert_allclose(mpc(circle), 0.0, atol=1e-12)


def model_of(case, inputs):
    m, n_out = len(case.poles), len(case.shapes)
    outputs = tuple(Dof.of(f"acc{k}", 2) for k in range(n_out))
    zeros = np.zeros((n_out, len(inputs)))
    return ModalModel(
        case.poles,
        case.shapes,
        case.shapes[case.drives][: len(inputs)],
        zeros,
        zeros,
        outputs,
        inputs,
        np.zeros(m),
        np.zeros(m),
    )


def test_a_modal_model_synthesises_its_frfs_and_knows_its_scale():
    case = modal_case(5, 3, **SMALL)
    inputs = tuple(Dof.of(f"acc{k}", 2) for k in case.drives)
    model = model_of(case, inputs)
    frf = model.synthesise(case.freq_hz, "accelerance")
    np.testing.assert_allclose(
        frf.values, case.clean, rtol=1e-12, atol=1e-12 * np.abs(case.clean).max()
    )
    np.testing.assert_allclose(model.modal_a, 1.0, rtol=1e-12)


def test_a_modal_model_without_a_drive_point_has_no_scale():
    case = modal_case(5, 3, **SMALL)
    model = model_of(case, (Dof("hit99", "+tz"), Dof("hit98", "+tz")))
    with pytest.raises(UsageError, match="without a drive point"):
        _ = model.modal_a


def test_modes_that_are_held_stay_and_the_others_find_the_same_place():
    case = modal_case(8, 3, **{**SMALL, "total": 3, "lines": 101, "start": 5})
    data = data_of(case)
    whole, matrix = refine(data, *start_of(case, 3))
    poles, participation = whole.poles.copy(), whole.participation.copy()
    poles[1] *= 1.002
    free_modes = np.array([False, True, False])
    again, small = refine(data, poles, participation, free_modes=free_modes)
    np.testing.assert_array_equal(again.poles[[0, 2]], whole.poles[[0, 2]])
    np.testing.assert_array_equal(again.participation[:, [0, 2]], whole.participation[:, [0, 2]])
    np.testing.assert_allclose(again.poles[1], whole.poles[1], rtol=1e-5)
    # Its part of the normal matrix is that of the whole: Re s, Im s stand first in both.
    assert small.shape == (4, 4)
    np.testing.assert_allclose(small[:2, :2], matrix[np.ix_([1, 4], [1, 4])], rtol=1e-3)
