"""Where sensors tell the shapes of modes apart."""

from itertools import combinations

import numpy as np
import pytest

from identification.shapes import antinodes, distinguish_modes, effective_independence
from identification.words import UsageError


def test_antinodes_are_where_modes_move_most():
    x = np.linspace(0, 1, 41)
    beams = np.array([np.sin(np.pi * x), np.sin(2 * np.pi * x), np.sin(3 * np.pi * x)])
    assert antinodes(beams).tolist() == [20, 10]  # the third moves most at 20, too
    apart = np.abs(x[:, None] - x) / 0.15
    chosen = antinodes(beams, 2, apart)
    assert chosen[0] == 20
    assert len(chosen) == 4  # what one mode has taken counts for the others
    distances = np.abs(x[chosen][:, None] - x[chosen]) + np.eye(len(chosen))
    assert distances.min() >= 0.15
    vectors = np.zeros((1, 4, 3))
    vectors[0, 2] = [0.3, 0.3, 0.3]
    vectors[0, 1, 0] = 0.4
    assert antinodes(vectors).tolist() == [2]


def test_effective_independence_is_nearly_the_best_of_all_choices():
    random = np.random.default_rng(10)
    ranks = []
    for _ in range(10):
        candidates = random.standard_normal((3, 9))
        chosen = effective_independence(candidates, 4)
        worth = {
            one: np.linalg.det(candidates[:, one] @ candidates[:, one].T)
            for one in combinations(range(9), 4)
        }
        ranks.append(sorted(worth.values(), reverse=True).index(worth[tuple(chosen.tolist())]))
    assert np.median(ranks) <= 3  # of 126
    with pytest.raises(UsageError, match="2 channels of 9 candidates cannot tell 3 modes"):
        effective_independence(candidates, 2)
    with pytest.raises(UsageError, match="equal at all candidates"):
        effective_independence(np.vstack([candidates, candidates[:1]]), 5)


def test_modes_alike_but_out_of_phase_are_told_by_the_channels_that_differ():
    same = np.array([1.0, 0.8, 0.6, 0.05, 0.05])
    other = np.array([1.0, 0.8, 0.6, 0.05, -0.3])
    third = np.array([0.0, 0.0, 1.0, -1.0, 0.5])
    found = distinguish_modes(np.array([same, other, third]), noise=0.1)
    assert found.confused == ((0, 1),)
    assert found.channels[0][0] == 4
    np.testing.assert_allclose(np.diag(found.mac), 1.0)
    expected = np.sqrt(1 - found.mac[0, 1]) / 0.1
    assert found.deviations[0, 1] == pytest.approx(expected)
    apart = np.sign(same) * np.abs(same), same * [1, 1, -1, 1, 1]
    assert distinguish_modes(np.array(apart)).confused == ()  # unsigned they would be the same
