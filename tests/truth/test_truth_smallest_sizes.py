"""Smallest sizes: gains against bounded least squares, the needed gain in closed form, twins."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from truth import Protocol, Tolerance, Weighing, find_signatures, linearise_test, predict_smallest
from truth.campaign.bounded_least_squares import BOUND
from truth.campaign.signatures import gram_matrix
from truth.campaign.smallest_sizes import OUTLIER_SIGMA, needed_gain
from truth.effects import CATALOGUE
from truth.effects.effect import stated_number
from truth.machine.random_tree import draw_tree

NINE_OF_TEN = 1.2815515655446004


@pytest.fixture(scope="module")
def test():
    tree = draw_tree(12, 2)
    protocol = Protocol((tree.first_aim(),), lines=161, resolution_hz=1.0)
    return linearise_test(tree, protocol, Tolerance())


@pytest.fixture(scope="module")
def found(test):
    names = ("mass_error", "structural_damping", "viscoelastic", "sensor_gain")
    return find_signatures(test, {name: CATALOGUE[name] for name in names}, [])


def jacobian_of(test):
    """J of all parameters over the noise of the whole test, with the prior beneath it."""
    refit, split = test.refit, test.refit.shared.shape[1]
    each = refit.own.shape[2]
    shape = (2, *refit.deviation.shape)
    full = np.zeros((2 * refit.deviation.size, split + each * len(refit.own)))
    full[:, :split] = refit.shared
    for number, columns in enumerate(refit.own):
        block = np.zeros((*shape, each))
        own = block[:, :, 3 * number : 3 * number + 3]
        block[:, :, 3 * number : 3 * number + 3] = columns.reshape(own.shape)
        full[:, split + each * number : split + each * (number + 1)] = block.reshape(-1, each)
    return np.vstack([np.sqrt(test.scale) * full, np.diag(refit.bounded / np.sqrt(2))])


def test_a_gain_is_what_bounded_least_squares_leaves(test, found):
    signatures, information = found
    jacobian = jacobian_of(test)
    limit = np.where(test.refit.bounded, BOUND, np.inf)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0] = 1.0
    for signature in signatures[::5]:
        for part in (0.1, 1.0, 3.0):
            size = part * signature.drawn.size
            goal = np.append(size * signature.change, np.zeros(information.normal.shape[0]))
            bounds = (-limit * scale, limit * scale)
            fit = lsq_linear(jacobian / scale, goal, bounds, method="bvls", tol=1e-14)
            assert information.gain(signature, size) == pytest.approx(2 * fit.cost, rel=1e-3)


def test_the_gram_matrix_is_the_gain_without_bounds(test, found):
    signatures, information = found
    free = replace(information, bounded=np.zeros_like(information.bounded))
    for number, signature in enumerate(signatures[:4]):
        gain = gram_matrix(signatures)[number, number] * 0.01**2
        assert free.gain(signature, 0.01) == pytest.approx(gain, rel=1e-3)


def test_the_slope_is_that_of_the_frfs(test, found):
    """A tenth of the size at which it is taken changes the FRFs by a tenth."""
    signature = next(one for one in found[0] if one.effect == "structural_damping")
    size = 0.1 / float(np.linalg.norm(signature.change))
    machine = replace(test.refit.machine, effects=(signature.drawn.sized(size),))
    change = np.sqrt(test.scale) * test.refit.weighted(test.refit.change(machine))
    np.testing.assert_allclose(change, size * signature.change, atol=2e-4)


def test_the_needed_gain_is_the_root_of_its_equation():
    """Without rivals and hidden gap kappa (g - z sqrt(2 g)) = ln M, a quadratic in sqrt(g)."""
    weighing = Weighing(weight=0.03, hidden=1e-30, hidden_width=0.27, values=1000)
    root = NINE_OF_TEN / np.sqrt(2) + np.sqrt(NINE_OF_TEN**2 / 2 + np.log(250) / 0.03)
    assert needed_gain(weighing, 250, np.zeros(0)) == pytest.approx(root**2, rel=1e-6)


def test_a_rival_that_explains_more_raises_it_and_a_twin_makes_it_infinite():
    weighing = Weighing(weight=0.03, hidden=0.01, hidden_width=0.27, values=10_000)
    gains = [needed_gain(weighing, 2, np.array([share, 0.0])) for share in (0.0, 0.9, 0.999)]
    assert gains[0] <= gains[1] < gains[2]
    assert np.isinf(needed_gain(weighing, 2, np.array([1.0, 1.0])))


def test_more_noise_that_may_hide_a_gap_raises_it():
    few, many = (Weighing(0.03, 0.01, 0.27, values) for values in (1000, 1_000_000))
    assert needed_gain(few, 9, np.zeros(8)) < needed_gain(many, 9, np.zeros(8))


def test_the_smallest_size_has_the_needed_gain(test, found):
    signatures, information = found
    weighing = Weighing(0.03, 0.01, 0.27, test.values)
    sizes = predict_smallest(signatures, information, weighing)
    assert {row.effect for row in sizes} == {one.effect for one in signatures}
    for row in sizes:
        if row.effect == "sensor_gain" and row.is_found:
            assert row.gain >= OUTLIER_SIGMA**2 / 2
    # No tolerance is at its bound, so that the gain is that which is needed.
    lossy = [one for one in signatures if one.effect == "structural_damping"][:1]
    (alone,) = predict_smallest(lossy, information, weighing)
    assert information.gain(lossy[0], alone.value) == pytest.approx(alone.gain, rel=0.05)
    confused = {row.location: row.confused for row in sizes if row.effect == "viscoelastic"}
    assert any(name.startswith("structural_damping") for row in confused.values() for name in row)


def test_a_size_is_stated_by_the_parameter_that_follows_it():
    """The length of an offset; nothing for a body's mode, whose frequency stays."""
    tree = draw_tree(12, 2)
    protocol = Protocol((tree.first_aim(),), lines=161, resolution_hz=1.0)
    test = linearise_test(tree, protocol, Tolerance())
    names = ("flexible_body", "joint_coupling")
    signatures, information = find_signatures(test, {name: CATALOGUE[name] for name in names}, [])
    rows = predict_smallest(signatures, information, Weighing(0.5, 0.03, 0.1, test.values))
    for row in rows:
        expected = "" if row.effect == "flexible_body" else "offset"
        assert row.parameter == (expected if row.is_found else "")
        assert (row.value is None) == (row.parameter == "")
        assert not row.is_found or row.of_usual > 0


@pytest.mark.parametrize(
    ("name", "value", "number"),
    [
        ("mass", 2.5, 2.5),
        ("offset", (3.0, 0.0, -4.0), 5.0),
        ("fraction", (1.0, 0.2, 1.0, 0.6), 0.2),
    ],
)
def test_one_number_stands_for_a_parameter(name, value, number):
    assert stated_number(name, value) == pytest.approx(number)
