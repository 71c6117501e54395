"""Weak modes at sums, differences and multiples of strong ones are doubted, others are not."""

import numpy as np
import pytest

from identification.modal import find_combination_tones
from identification.words import Dof, ModalModel


def modal_model(freq, strength, sd=0.003):
    """Return a model of these frequencies [Hz] and strengths of response, with 1 % damping."""
    freq, count = np.array(freq), len(freq)
    poles = 2 * np.pi * freq * (-0.01 + 1j * np.sqrt(1 - 0.01**2))
    return ModalModel(
        poles=poles,
        shapes=np.ones((3, count)) * np.array(strength),
        participation=np.ones((1, count)),
        lower=np.zeros((3, 1)),
        upper=np.zeros((3, 1)),
        outputs=tuple(Dof(f"acc{k}", "+tz") for k in (1, 2, 3)),
        inputs=(Dof("acc1", "+tz"),),
        freq_sd=np.full(count, sd),
        damping_sd=np.full(count, 1e-4),
    )


@pytest.mark.parametrize(
    ("weak", "words"),
    [
        (8.43, "2 times that of mode 1"),
        (15.453, "the difference of that of mode 3 and that of mode 1"),
        (23.883, "the sum of that of mode 2 and that of mode 1"),
        (12.645, "3 times that of mode 1"),
        (28.098, "the sum of twice that of mode 1 and that of mode 2"),
    ],
)
def test_a_weak_mode_at_a_combination_is_named_with_it(weak, words):
    freq = [4.215, 19.668, weak, 60.0]
    order = np.argsort(freq)
    strength = np.array([1.0, 1.0, 1e-3, 1.0])[order]
    tones = find_combination_tones(modal_model(np.array(freq)[order], strength), 4)
    assert list(tones) == [list(order).index(2)]
    assert words in next(iter(tones.values()))


def test_twice_a_frequency_is_named_also_among_many_modes():
    # Sums and differences of nine modes lie everywhere within 0.1 Hz, their doubles do not.
    freq = [35.7, 36.8, 56.7, 60.5, 62.7, 75.6, 89.1, 100.8, 137.0, 151.3]
    model = modal_model(freq, [1.0] * 9 + [1e-3], sd=0.03)
    assert "2 times that of mode 6" in find_combination_tones(model, 10)[9]


def test_a_strong_mode_at_a_combination_is_a_mode():
    model = modal_model([4.215, 8.43, 19.668], [1.0, 0.5, 1.0])
    assert find_combination_tones(model, 3) == {}


def test_a_weak_mode_elsewhere_is_a_mode():
    model = modal_model([4.215, 8.50, 19.668], [1.0, 1e-3, 1.0])
    assert find_combination_tones(model, 3) == {}


def test_weak_modes_among_many_are_rarely_doubted():
    # With twenty strong modes there are sums and differences everywhere.
    random, doubted = np.random.default_rng(1), 0
    for _ in range(50):
        freq = np.sort(random.uniform(5, 200, 21))
        strength = np.ones(21)
        strength[10] = 1e-3
        doubted += len(find_combination_tones(modal_model(freq, strength), 21))
    assert doubted <= 5
