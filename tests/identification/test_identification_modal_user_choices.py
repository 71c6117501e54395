"""What a user adds, drops, forces; and what are no modes, since hits contradict each other."""

import numpy as np
import pytest
from modal_case import modal_case

from identification.modal import ModeChoices, ModeCriteria, WeightedFrfs, identify_modes, mpc, mpd
from identification.words import UsageError


@pytest.fixture(scope="module")
def case():
    return modal_case(40_001, 6, total=8, n_out=12, lines=401, start=10)


@pytest.fixture(scope="module")
def data(case):
    s = 2j * np.pi * case.freq_hz
    return WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), 1 / case.sd**2)


def frequencies(data, case, choices=None):
    found = identify_modes(data, case.freq_hz, choices=choices)
    return found, found.fit.freq_hz[found.inside]


def test_a_dropped_mode_is_gone_and_the_others_stay(data, case) -> None:
    _, freq = frequencies(data, case, ModeChoices(drop=(case.modes_hz[2],)))
    others = np.delete(case.modes_hz, 2)
    assert len(freq) == 5
    np.testing.assert_allclose(freq, others, rtol=5e-3)


def test_a_mode_that_was_dropped_can_be_added_again(data, case) -> None:
    place = case.modes_hz[2]
    found, freq = frequencies(data, case, ModeChoices(drop=(place,), add=(1.004 * place,)))
    plain, _ = frequencies(data, case)
    np.testing.assert_allclose(freq, plain.fit.freq_hz[plain.inside], rtol=1e-6)
    assert found.misfit == pytest.approx(plain.misfit, rel=1e-4)


def test_a_forced_pole_stays_exactly_where_it_was_put(data, case) -> None:
    place, damping = 1.001 * case.modes_hz[3], 0.02
    found, freq = frequencies(data, case, ModeChoices(force=((place, damping),)))
    assert len(freq) == 6, "it takes the place of the mode found"
    own = int(np.abs(freq - place).argmin())
    assert freq[own] == pytest.approx(place, rel=1e-12)
    assert found.fit.damping[own] == pytest.approx(damping, rel=1e-12)
    assert found.freq_sd[own] == found.damping_sd[own] == 0
    assert (np.delete(found.freq_sd[found.inside], own) > 0).all()


@pytest.mark.parametrize(
    ("choices", "words"),
    [
        (ModeChoices(drop=(3.0,)), "outside the band"),
        (ModeChoices(add=(500.0,)), "outside the band"),
        (ModeChoices(force=((50.0, 1.5),)), "not between 0 and 1"),
    ],
)
def test_impossible_choices_are_refused_in_one_sentence(data, case, choices, words) -> None:
    with pytest.raises(UsageError, match=words):
        identify_modes(data, case.freq_hz, choices=choices)


def test_dropping_where_no_mode_is_names_those_that_are(data, case) -> None:
    empty = (case.modes_hz[:-1] + np.diff(case.modes_hz) / 2)[np.diff(case.modes_hz).argmax()]
    with pytest.raises(UsageError, match=f"{case.modes_hz[0]:.1f}"):
        identify_modes(data, case.freq_hz, choices=ModeChoices(drop=(empty,)))


def test_adding_where_the_data_hold_no_mode_says_where_the_pole_went(data, case) -> None:
    empty = (case.modes_hz[:-1] + np.diff(case.modes_hz) / 2)[np.diff(case.modes_hz).argmax()]
    with pytest.raises(UsageError, match="the pole went to"):
        identify_modes(data, case.freq_hz, choices=ModeChoices(add=(empty,)))


def drifting(seed, shift=1e-4, hits=24, fixed=3):
    """A roving hammer on a machine that warms up: every hit has frequencies of its own."""
    rng = np.random.default_rng(seed)
    freq = np.append(np.linspace(30, 170, 7) + rng.uniform(-5, 5, 7), [111.0, 111.4])
    damping = np.append(np.exp(rng.uniform(np.log(5e-4), np.log(9e-3), 7)), [3e-3, 2e-3])
    shapes = rng.normal(size=(hits, 9))
    sensors = rng.normal(size=(fixed, 9))
    axis = np.linspace(0, 200, 801)[20:]
    s = 2j * np.pi * axis
    values = np.zeros((len(s), fixed, hits), complex)
    for hit in range(hits):
        omega = 2 * np.pi * freq * (1 + shift * rng.normal())
        poles = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        residues = sensors * shapes[hit] / (2j * poles.imag)
        values[:, :, hit] = (residues / (s[:, None, None] - poles)).sum(2)
        values[:, :, hit] += (residues.conj() / (s[:, None, None] - poles.conj())).sum(2)
    values *= (s**2)[:, None, None]
    sd = 0.003 * np.sqrt((np.abs(values) ** 2).mean(axis=0))
    noise = rng.normal(size=(2, *values.shape)) / np.sqrt(2) * sd
    return (
        axis,
        WeightedFrfs(s, 2, values + noise[0] + 1j * noise[1], np.ones((len(s), 1, 1)), 1 / sd**2),
        freq,
    )


def test_a_machine_that_drifts_between_hits_has_hardly_more_modes_for_it() -> None:
    extra = 0
    for seed in (40_010, 40_012):
        axis, data, freq = drifting(seed)
        found = identify_modes(data, axis)
        inside = found.fit.freq_hz[found.inside]
        assert found.misfit > 2, "the hits contradict one another by more than noise"
        near = np.abs(inside[:, None] / freq - 1) < 1e-3
        assert near.any(axis=0).all(), "all nine, with the pair 0.4 Hz apart"
        extra += len(inside) - len(freq)
    assert extra <= 1, "of 18 resonances; without care each would be two"


def test_shapes_less_real_than_asked_are_no_modes(data, case) -> None:
    plain, freq = frequencies(data, case)
    own = mpc(plain.fit.shapes)[plain.inside]
    asked = float(np.sort(own)[:2].mean())
    real = identify_modes(data, case.freq_hz, ModeCriteria(collinearity=asked))
    kept = real.fit.freq_hz[real.inside]
    np.testing.assert_allclose(kept, np.delete(freq, own.argmin()), rtol=2e-3)


def test_shapes_whose_phases_stray_more_than_asked_are_no_modes(data, case) -> None:
    plain, freq = frequencies(data, case)
    own = mpd(plain.fit.shapes)[plain.inside]
    asked = float(np.sort(own)[-2:].mean())
    real = identify_modes(data, case.freq_hz, ModeCriteria(phase_deviation=asked))
    kept = real.fit.freq_hz[real.inside]
    np.testing.assert_allclose(kept, np.delete(freq, own.argmax()), rtol=2e-3)
