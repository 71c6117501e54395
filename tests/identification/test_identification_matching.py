"""Measured modes and simulated ones: as printed, by shape and sign, one to one."""

import time
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import scipy.stats

from identification.impacts import ImpactSpectra
from identification.matching import (
    ImpactModes,
    MatchingPriors,
    ModeMatch,
    best_matching,
    choose_reference,
    estimate_by_hand,
    impact_modes,
    match_by_ratios,
    pair_probabilities,
    pairing_odds,
    rotate_to_real,
)
from identification.matching.likelihood import mixing
from identification.words import ConvergenceError, Dof, UsageError

FREQ = np.arange(20.0, 100.0, 0.2)
HZ = np.array([31.0, 44.0, 62.0, 81.0])
ZETA = np.array([0.03, 0.02, 0.025, 0.016])
DOFS = tuple(Dof.parse(f"acc{k}:+t{a}") for k in (1, 2, 3) for a in "xyz") + tuple(
    Dof.parse(f"acc{k}:+tz") for k in range(4, 10)
)


def rung(random, shapes, excited, noise=1e-3):
    """Spectra of free decays, one column of ``excited`` each impact."""
    omega = 2 * np.pi * HZ
    poles = omega * (-ZETA + 1j * np.sqrt(1 - ZETA**2))
    s = 2j * np.pi * FREQ[:, None]
    phases = np.exp(1j * random.uniform(-np.pi, np.pi, excited.shape))
    gain = excited * phases
    values = np.einsum("fm,mc,mk->fck", 1 / (s - poles), shapes, gain)
    values += np.einsum("fm,mc,mk->fck", 1 / (s - poles.conj()), shapes, gain.conj())
    variance = np.full((shapes.shape[1], excited.shape[1]), (noise * np.abs(values).max()) ** 2)
    error = random.standard_normal((2, *values.shape)) / np.sqrt(2)
    values = values + np.sqrt(variance) * (error[0] + 1j * error[1])
    names = tuple(f"impact{k}" for k in range(excited.shape[1]))
    return ImpactSpectra(names, DOFS, FREQ, values, variance)


@pytest.fixture(scope="module")
def drawn():
    random = np.random.default_rng(1)
    shapes = random.standard_normal((4, len(DOFS)))
    shapes[3] = shapes[2] * np.where(np.arange(len(DOFS)) < 8, 1, -1)  # alike, out of phase
    excited = random.uniform(0.5, 2, (4, 3))
    excited[1, 0] = 0.0  # struck at a node of the second
    return shapes, excited, rung(random, shapes, excited)


def test_modes_of_impacts_have_their_poles_shapes_and_what_excites_them(drawn):
    shapes, excited, spectra = drawn
    found = impact_modes(spectra)
    assert found.frequencies == pytest.approx(HZ, rel=1e-3)
    assert found.dampings == pytest.approx(ZETA, rel=0.03)
    unit = shapes / np.linalg.norm(shapes, axis=1)[:, None]
    sign = np.sign((found.shapes * unit).sum(axis=1))[:, None]
    away = found.shapes * sign - unit
    assert np.abs(away).max() < 0.03
    assert 0.5 < np.mean(away**2 / found.variance) < 2.0
    assert (found.collinearity > 0.98).all()
    assert found.excitation[1, 0] < 0.05 * found.excitation[1].max()
    weaker = found.excitation / found.excitation.max(axis=1)[:, None]
    expected = excited / excited.max(axis=1)[:, None]
    np.testing.assert_allclose(weaker, expected, atol=0.05)


def test_noise_alone_holds_no_mode():
    random = np.random.default_rng(2)
    spectra = rung(random, np.zeros((4, len(DOFS))), np.ones((4, 2)))
    error = random.standard_normal((2, *spectra.values.shape))
    noise = replace(
        spectra, values=error[0] + 1j * error[1], variance=np.full(spectra.variance.shape, 2.0)
    )
    with pytest.raises(ConvergenceError, match="exceeds the noise"):
        impact_modes(noise)


def test_what_is_alike_but_out_of_phase_is_told_by_its_sign(drawn):
    shapes, _, spectra = drawn
    measured = impact_modes(spectra)
    random = np.random.default_rng(3)
    simulated = shapes[::-1] + 0.25 * random.standard_normal(shapes.shape)
    same, band = np.array([30.0, 45.0, 65.0, 95.0]), (20.0, 100.0)
    blunt = MatchingPriors(frequency_error=2.0)  # frequencies tell nothing
    pairs = pair_probabilities(pairing_odds(measured, simulated, same, band, blunt))
    assert pairs.argmax(axis=1).tolist() == [3, 2, 1, 0]
    assert (pairs.max(axis=1) > 0.9).all()
    unsigned = np.abs(simulated)
    blind = replace(measured, shapes=np.abs(measured.shapes))
    assert pair_probabilities(pairing_odds(blind, unsigned, same, band, blunt))[2:].max() < 0.9


def test_what_the_simulation_does_not_have_is_no_match(drawn):
    shapes, _, spectra = drawn
    measured = impact_modes(spectra)
    without = shapes[[0, 1, 3]]
    table = pairing_odds(measured, without, HZ[[0, 1, 3]], (20.0, 100.0))
    pairs = pair_probabilities(table)
    assert 1 - pairs[2].sum() > 0.9
    assert best_matching(table) == {0: 0, 1: 1, 3: 2}


def test_odds_are_the_ratio_of_two_densities():
    random = np.random.default_rng(4)
    shape, other = random.standard_normal((2, 6))
    variance = random.uniform(0.01, 0.1, 6)
    measured = ImpactModes(
        *(np.array([50.0]), np.array([0.02]), np.array([0.1]), np.array([0.001])),
        shape[None], variance[None], np.ones((1, 1)), np.ones(1),
    )  # fmt: skip
    own = MatchingPriors(
        shape_error=0.3, frequency_error=0.1, independent_channels=6.0, no_match=0.25
    )
    (found,) = pairing_odds(measured, other[None], np.array([54.0]), (20.0, 100.0), own)[0]
    size = shape @ shape
    base = np.diag(variance) + 0.09 * size / 6 * np.eye(6)

    def density(matrix):
        return np.exp(-0.5 * shape @ np.linalg.solve(matrix, shape)) / np.sqrt(
            np.linalg.det(matrix)
        )

    shapes = density(base + size / (other @ other) * np.outer(other, other))
    shapes /= density(base + size / 6 * np.eye(6))
    near = np.exp(-0.5 * (np.log(50 / 54) / 0.1) ** 2) / np.sqrt(2 * np.pi) / 0.1 * np.log(5.0)
    assert found == pytest.approx(3.0 * shapes * near)


def test_a_mode_may_hold_what_lies_near_it():
    """Closed form: (2 k)^2 / 2 over itself and the distance, half of all at one frequency."""
    found = mixing(np.array([40.0, 40.0, 40.4, 80.0]), 0.005) ** 2
    assert found[0, 1] == pytest.approx(0.5)
    far = 2 * np.log(1.01)
    assert found[0, 2] == pytest.approx(0.5 * 1e-4 / (1e-4 + far**2))
    assert found[0, 3] < 1e-4
    assert (np.diag(found) == 1).all()
    np.testing.assert_array_equal(found, found.T)


def test_two_modes_at_one_frequency_are_told_however_they_are_turned():
    random = np.random.default_rng(14)
    at = np.linalg.qr(random.standard_normal((12, 4)))[0].T
    turned = np.array([0.6 * at[0] + 0.8 * at[1], -0.8 * at[0] + 0.6 * at[1], at[2], at[3]])
    hz = np.array([36.0, 36.2, 50.0, 70.0])
    measured = ImpactModes(
        *(hz, 0.01 * np.ones(4), 0.02 * np.ones(4), 1e-3 * np.ones(4)),
        turned, np.full((4, 12), 1e-5), np.ones((4, 1)), np.ones(4),
    )  # fmt: skip
    apart = pair_probabilities(
        pairing_odds(measured, at, np.array([40.0, 44.0, 55.0, 77.0]), (20, 100))
    )
    same = pair_probabilities(
        pairing_odds(measured, at, np.array([40.0, 40.01, 55.0, 77.0]), (20, 100))
    )
    assert (same[:2, :2].sum(axis=1) > 0.9).all()
    assert (apart[:2, :2].sum(axis=1) < same[:2, :2].sum(axis=1)).all()


def test_a_mixed_shapes_odds_are_the_ratio_of_two_densities():
    random = np.random.default_rng(15)
    shape, *at = random.standard_normal((4, 5))
    at, hz = np.array(at), np.array([40.0, 40.5, 43.0])
    measured = ImpactModes(
        *(np.array([41.0]), np.array([0.02]), np.array([0.1]), np.array([0.001])),
        shape[None], np.full((1, 5), 0.05), np.ones((1, 1)), np.ones(1),
    )  # fmt: skip
    own = MatchingPriors(
        shape_error=0.3, frequency_error=0.1, coupling=0.02, independent_channels=5.0, no_match=0.5
    )
    found = pairing_odds(measured, at, hz, (20.0, 100.0), own)[0]
    size = shape @ shape
    base = (0.05 + 0.09 * size / 5) * np.eye(5)
    shares = mixing(hz, 0.02)
    for a in range(3):
        whole = sum(shares[a, b] ** 2 * np.outer(at[b], at[b]) for b in range(3))
        whole *= size / np.trace(whole)
        near = scipy.stats.norm.pdf(np.log(41.0 / hz[a]), scale=0.1) * np.log(5.0)
        ratio = scipy.stats.multivariate_normal.logpdf(
            shape, cov=base + whole
        ) - scipy.stats.multivariate_normal.logpdf(shape, cov=base + size / 5 * np.eye(5))
        assert found[a] == pytest.approx(np.exp(ratio) * near)


@pytest.mark.parametrize("size", [(3, 4), (4, 3), (4, 4)])
def test_probabilities_of_pairs_are_those_of_all_matchings(size):
    random = np.random.default_rng(5)
    table = np.exp(random.normal(0.0, 2.0, size))
    total, pairs, best = 0.0, np.zeros(size), (0.0, {})
    count, others = size
    seen = set()
    for chosen in permutations([*range(others), *[None] * count], count):
        if chosen in seen:
            continue
        seen.add(chosen)
        matched = {m: a for m, a in enumerate(chosen) if a is not None}
        weight = np.prod([table[m, a] for m, a in matched.items()])
        total += weight
        for m, a in matched.items():
            pairs[m, a] += weight
        best = max(best, (weight, matched), key=lambda one: one[0])
    np.testing.assert_allclose(pair_probabilities(table), pairs / total, rtol=1e-9)
    assert best_matching(table) == best[1]


def test_odds_of_any_size_give_probabilities():
    random = np.random.default_rng(6)
    table = np.exp(random.normal(0, 120.0, (14, 14)))
    found = pair_probabilities(table)
    assert np.isfinite(found).all()
    assert (found.sum(axis=1) <= 1 + 1e-9).all()
    assert (found.sum(axis=0) <= 1 + 1e-9).all()
    assert pair_probabilities(np.zeros((2, 3))).sum() == 0


def hardly_told(seed, count):
    """Odds of so many measured modes, two simulated ones more."""
    random = np.random.default_rng(seed)
    measured, simulated = (np.sort(random.uniform(20, 95, n)) for n in (count, count + 2))
    near = np.exp(-0.5 * (np.log(measured[:, None] / simulated) / 0.15) ** 2)
    return 4 * near * np.exp(random.standard_normal(near.shape))


def test_many_modes_that_few_channels_hardly_tell_take_seconds():
    """A permanent has no short cut: of 18 modes by 20 not all sets are followed."""
    begun = time.process_time()
    found = pair_probabilities(hardly_told(16, 18))
    assert time.process_time() - begun < 15
    assert (found.sum(axis=1) <= 1 + 1e-9).all()
    assert (found.sum(axis=0) <= 1 + 1e-3).all()


def test_sets_that_are_left_out_move_probabilities_little(monkeypatch):
    table = hardly_told(17, 12)
    exact = pair_probabilities(table)
    monkeypatch.setattr("identification.matching.mode_matching._MAX_SETS", 1000)  # of 4096
    np.testing.assert_allclose(pair_probabilities(table), exact, atol=0.02)


def test_a_mode_alone_has_nothing_to_be_told_from(drawn):
    shapes, _, spectra = drawn
    measured = impact_modes(spectra)
    found = ModeMatch(
        measured, HZ[:1], shapes[:1], pairing_odds(measured, shapes[:1], HZ[:1], (20.0, 100.0))
    )
    assert found.telling_channels(0) == ()
    assert found.pairs == {0: 0}


def test_a_mode_that_no_channel_sees_has_no_ratios_and_no_say(drawn):
    shapes, _, spectra = drawn
    blind = np.vstack([shapes, np.zeros(shapes.shape[1])])
    found = match_by_ratios(spectra, blind, spectra.dofs[0].point)
    assert np.isfinite(found.closeness).all()
    assert not found.simulated[-1].any()
    assert choose_reference(blind, spectra.dofs) == choose_reference(shapes, spectra.dofs)
    assert choose_reference(0 * shapes, spectra.dofs) == spectra.dofs[0].point
    pairs = pair_probabilities(
        pairing_odds(impact_modes(spectra), blind, np.r_[HZ, 50.0], (20.0, 100.0))
    )
    assert pairs[:, -1].max() < 0.5


def test_a_shape_of_one_phase_is_real_and_keeps_its_signs():
    random = np.random.default_rng(7)
    shape = random.standard_normal(9)
    found = rotate_to_real(shape * np.exp(0.9j))
    np.testing.assert_allclose(np.abs(found), np.abs(shape), atol=1e-12)
    assert abs(found @ shape) == pytest.approx(np.linalg.norm(found) * np.linalg.norm(shape))


def test_the_printed_match_peaks_where_ratios_are_the_simulated(drawn):
    shapes, _, clean = drawn
    for reading in ("largest", "reference"):
        found = match_by_ratios(clean, shapes, "acc2", reading=reading, width_hz=0.3)
        assert found.places == tuple(f"acc{k}" for k in range(1, 10))
        assert found.closeness.shape == (len(FREQ), 4, 3)
    triaxial = np.linalg.norm(shapes[:, 3:6], axis=1)
    np.testing.assert_allclose(found.simulated[:, 1], 1.0)
    np.testing.assert_allclose(found.simulated[:, 3], np.abs(shapes[:, 9]) / triaxial)
    line = 150
    amplitude = np.abs(clean.values[line])
    narrow = match_by_ratios(clean, shapes, "acc2", reading="reference", width_hz=0.0)
    own = [[dof.point == place for dof in DOFS] for place in narrow.places]
    places = [np.linalg.norm(amplitude[one], axis=0) for one in own]
    ratios = np.array(places) / places[1]
    by_hand = 1 / ((ratios - narrow.simulated[0][:, None]) ** 2).sum(axis=0)
    np.testing.assert_allclose(narrow.closeness[line, 0], by_hand)
    peak = narrow.mean[:, 0]
    assert FREQ[narrow.peaks[0]] == pytest.approx(HZ[0], abs=1.0)
    assert peak.max() > 5 * np.median(peak)
    with pytest.raises(UsageError, match="acc77 is not among the places acc1"):
        match_by_ratios(clean, shapes, "acc77")


@pytest.mark.parametrize("late", [0.0, 2e-3], ids=["on time", "2 ms late"])
def test_damping_and_amplitude_by_hand_are_those_of_a_single_mode(late):
    hz, zeta, freq = 34.5, 0.02, np.arange(20.0, 60.0, 0.02)
    amplitude = np.array([0.7832, -0.4002, 1.4137])
    ratio = 1j * freq / hz
    response = ratio**2 / (ratio**2 + 2 * zeta * ratio + 1) - 1
    values = (response * np.exp(2j * np.pi * hz * late))[:, None, None] * amplitude[:, None]
    spectra = ImpactSpectra(("one",), DOFS[:3], freq, values, np.full((3, 1), 1e-9))
    unit = (amplitude / np.linalg.norm(amplitude))[None]
    one = np.ones(1)
    modes = ImpactModes(
        hz * one, zeta * one, 0.1 * one, 0.1 * one, unit, 0 * unit, np.ones((1, 1)), one
    )
    rows = estimate_by_hand(spectra, modes, 0)
    assert [row.channel for row in rows] == [str(DOFS[k]) for k in (2, 0, 1)]
    size_of = dict(zip(map(str, DOFS), amplitude, strict=False))
    signs = {np.sign(row.least_squares / size_of[row.channel]) for row in rows}
    assert len(signs) == 1  # the channel that moves against the others has the other sign
    for row in rows:
        size = abs(size_of[row.channel])
        assert row.damping == pytest.approx(zeta, rel=2e-3)
        assert row.peak == pytest.approx(hz, abs=0.03)
        assert abs(row.least_squares) == pytest.approx(size, rel=5e-3)
        assert abs(row.maximum) == pytest.approx(size, rel=5e-3)


def test_a_mode_that_is_not_alone_has_no_row_by_hand(drawn):
    _, _, spectra = drawn
    modes = impact_modes(spectra)
    rows = [estimate_by_hand(spectra, modes, mode) for mode in range(4)]
    assert [max(len(row) for row in rows)] == [3]
    for mode, row in enumerate(rows):
        for one in row:
            assert one.lower < one.peak < one.upper
            assert abs(one.peak - HZ[mode]) < 2 * ZETA[mode] * HZ[mode]
            assert 0.3 * ZETA[mode] < one.damping < 3 * ZETA[mode]


def test_ratios_are_taken_to_the_place_that_no_mode_leaves_at_rest():
    at = np.zeros((2, len(DOFS)))
    at[0, [0, 3, 6]] = 1.0, 0.5, 0.01  # at acc1, acc2 and acc3
    at[1, [0, 4, 7]] = 0.02, -0.6, 1.0
    assert choose_reference(at, DOFS) == "acc2"
    assert choose_reference(at * [[1000.0], [1.0]], DOFS) == "acc2"  # however modes are normalised
