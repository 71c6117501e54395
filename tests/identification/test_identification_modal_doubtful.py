"""Modes that explain how hits differ are marked; real modes as close are not."""

from dataclasses import dataclass

import numpy as np
import pytest

from identification.modal import (
    MeasuredFrfs,
    find_doubtful_modes,
    identify,
    identify_modes,
    scale_shapes,
)
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Layout,
    ModalModel,
    Test,
)

FREQ = np.arange(20, 480) * 0.125
PAIR_HZ = 16.1, 16.15  # 0.3 % apart
MODES_HZ = np.array([6.2, 11.0, *PAIR_HZ, 23.0, 31.0, 38.0, 44.2, 52.0])


@dataclass(frozen=True)
class Drawn:
    """Modes inside the band: their frequencies, and the reasons to doubt each."""

    freq_hz: np.ndarray
    reasons: tuple[tuple[str, ...], ...]

    def frequencies(self, *, doubtful):
        return self.freq_hz[[bool(reasons) == doubtful for reasons in self.reasons]]


def a_roving_test(seed, drift, *, hits=60, sensors=3):
    """Accelerance of roving hits; each meets frequencies and dampings of its own."""
    rng = np.random.default_rng(seed)
    damping = rng.uniform(0.006, 0.02, len(MODES_HZ))
    damping[2:4] = 0.01
    shapes, sensor_shapes = (rng.normal(size=(n, len(MODES_HZ))) for n in (hits, sensors))
    s = 2j * np.pi * FREQ[:, None]
    values = np.zeros((len(FREQ), hits, sensors), complex)
    for hit in range(hits):
        shift = drift * (rng.normal() + 0.5 * rng.normal(size=len(MODES_HZ)))
        zeta = damping * (1 + 50 * drift * rng.normal(size=len(MODES_HZ)))
        omega = 2 * np.pi * MODES_HZ * (1 + shift)
        poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
        scale = 1 / (2j * poles.imag)
        gain = scale / (s - poles) + scale.conj() / (s - poles.conj())
        values[:, hit] = s**2 * np.einsum("fm,m,sm->fs", gain, shapes[hit], sensor_shapes)
    sd = 0.01 * np.sqrt((np.abs(values) ** 2).mean(axis=0))
    error = sd * rng.normal(size=(2, *values.shape)) / np.sqrt(2)
    variance = np.broadcast_to(sd**2, values.shape)
    measured = np.ones((hits, sensors), bool)
    noisy = values + error[0] + 1j * error[1]
    return MeasuredFrfs(FREQ, noisy, variance, measured, (), (), 2, 0.0)


def drawn(seed, drift):
    measured = a_roving_test(seed, drift)
    identified = identify_modes(measured.weight_by_variance(), measured.freq_hz)
    fit, order = identified.fit, np.argsort(~identified.inside, kind="stable")
    n_out, n_in, count = len(fit.shapes), len(fit.participation), int(identified.inside.sum())
    model = ModalModel(
        fit.poles[order],
        fit.shapes[:, order],
        fit.participation[:, order],
        fit.lower,
        fit.upper,
        tuple(Dof(f"hit{k}", "+tz") for k in range(n_out)),
        tuple(Dof(f"acc{k}", "+tz") for k in range(n_in)),
        identified.freq_sd[order],
        identified.damping_sd[order],
    )
    return Drawn(model.freq_hz[:count], find_doubtful_modes(model, count, identified.misfit))


@pytest.mark.parametrize("seed", range(2))
def test_real_modes_and_a_close_pair_are_not_doubtful(seed):
    found = drawn(seed, 0.0)
    assert len(found.freq_hz) == len(MODES_HZ)
    assert not any(found.reasons)


@pytest.mark.parametrize(("seed", "drift"), [(0, 3e-4), (4, 3e-4), (1, 1e-3)])
def test_modes_of_hits_that_differ_are_doubtful_and_every_true_mode_stays(seed, drift):
    found = drawn(seed, drift)
    assert len(found.freq_hz) > len(MODES_HZ)
    kept = found.frequencies(doubtful=False)
    assert len(kept) == len(MODES_HZ)
    np.testing.assert_allclose(np.sort(kept), MODES_HZ, rtol=2e-3)
    for reasons in found.reasons:
        assert all("hits" in reason for reason in reasons)


def test_modes_that_two_drive_points_confirm_are_not_doubtful():
    rng = np.random.default_rng(3)
    shapes = rng.normal(size=(8, 2)) + 1j * rng.normal(size=(8, 2))
    poles = 2j * np.pi * np.array([10.0, 20.0]) - 0.5
    dofs = tuple(Dof(f"acc{k}", "+tz") for k in range(8))
    zeros = np.zeros((8, 2))
    model = ModalModel(
        poles, shapes, shapes[:2], zeros, zeros, dofs, dofs[:2], np.ones(2), np.ones(2)
    )
    assert all(find_doubtful_modes(model, 2, 9.0))
    assert not any(find_doubtful_modes(model, 2, 9.0, np.array([0.99, 0.99])))
    assert not any(find_doubtful_modes(model, 2, 1.1))


def a_plate(spans, seed, noise):
    """One drive point; the shape of the second mode there is ``spans`` of that elsewhere."""
    rng = np.random.default_rng(seed)
    outputs = tuple(Dof(f"acc{k}", "+tz") for k in range(1, 7))
    shapes = np.random.default_rng(1).uniform(0.5, 1.0, size=(6, 3))
    shapes[0, 1] = spans
    omega, zeta = 2 * np.pi * np.array([12.0, 25.0, 40.0]), 0.01
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    scale = 1 / (2j * poles.imag)
    s = 2j * np.pi * FREQ[:, None]
    gain = s**2 * (scale / (s - poles) + scale.conj() / (s - poles.conj()))
    clean = np.einsum("fm,om,m->fo", gain, shapes, shapes[0])[:, :, None]
    sd = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
    error = sd * rng.normal(size=(2, *clean.shape)) / np.sqrt(2)
    frf = Frf(FREQ, clean + error[0] + 1j * error[1], outputs, outputs[:1], "accelerance")
    variance = np.broadcast_to(sd**2, clean.shape)
    estimate = FrfEstimate(frf, variance, "differences", np.ones((6, 1), bool))
    layout = Layout(
        ("plate",), np.zeros((1, 3)), tuple(d.point for d in outputs), np.zeros(6, int),
        np.eye(6)[:, :3], np.tile(np.eye(3), (6, 1, 1)),
    )  # fmt: skip
    test = Test(Condition("plate.uff", outputs[0]), estimate)
    return Campaign("plate", layout, (test,)), shapes


def sizes(spans, noise, seeds):
    """Size of the second shape over its true one, and its stated relative standard deviation."""
    ratios, stated = [], []
    for seed in range(seeds):
        campaign, shapes = a_plate(spans, seed, noise)
        model, identified, _ = identify(campaign)
        scaled = scale_shapes(model, campaign.layout, identified.residue_sd)
        mode = int(np.argmin(np.abs(model.freq_hz - 25)))
        ratios.append(np.linalg.norm(scaled.model.shapes[1:, mode]) / np.linalg.norm(shapes[1:, 1]))
        stated.append(scaled.scale_sd[mode])
    return np.array(ratios), np.array(stated)


def test_the_scale_of_a_shape_scatters_as_its_standard_deviation_says():
    ratios, stated = sizes(0.02, 0.002, 10)
    assert 0.02 < stated.mean() < 0.3
    assert 0.5 < ratios.std() / stated.mean() < 1.7


def test_a_drive_point_away_from_nodes_gives_a_small_deviation():
    assert sizes(0.8, 0.002, 1)[1][0] < 0.01
