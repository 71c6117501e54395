"""Smallest sizes: signatures against least squares, rates of verdicts at the predicted size."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.linearised import stack_jacobian
from truth import Protocol, Tolerances, Weighing, find_signatures, linearise_test, predict_smallest
from truth.campaign.linear_verdicts import LinearVerdicts
from truth.campaign.signatures import gram_matrix
from truth.campaign.smallest_sizes import find_thresholds
from truth.campaign.tolerance_shift import list_without_tolerance, shift_of
from truth.effects import CATALOGUE
from truth.effects.effect import stated_number
from truth.machine.random_tree import draw_tree
from truth.random_streams import stream

WEIGHING = Weighing(
    values=9000.0,
    fitted_values=4500.0,
    counted_values=9000.0,
    error_values=32.0,
    noise_exponent=10.0,
    max_noise_share=0.99,
    hidden=0.01,
    hidden_width=0.27,
    min_closed=0.2,
    outlier=4.5,
)


@pytest.fixture(scope="module")
def test():
    tree = draw_tree(12, 2)
    protocol = Protocol((tree.first_aim(),), lines=161, resolution_hz=1.0)
    return linearise_test(tree, protocol, Tolerances())


@pytest.fixture(scope="module")
def found(test):
    names = ("mass_error", "structural_damping", "viscoelastic", "sensor_gain")
    return find_signatures(test, {name: CATALOGUE[name] for name in names}, [])


def test_the_gram_matrix_holds_what_least_squares_leaves(test, found):
    signatures, _ = found
    jacobian, gram = stack_jacobian(test), gram_matrix(signatures)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0] = 1.0
    left = []
    for signature in signatures[::9]:
        goal = np.append(signature.change, np.zeros(jacobian.shape[1]))
        found_steps = np.linalg.lstsq(jacobian / scale, goal, rcond=1e-13)[0]
        left.append(goal - jacobian / scale @ found_steps)
    exact = np.array(left) @ np.array(left).T
    size = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(
        gram[::9, ::9] / np.outer(size, size), exact / np.outer(size, size), atol=2e-3
    )


def test_the_slope_is_that_of_the_frfs(test, found):
    """A tenth of the size at which it is taken changes the FRFs by a tenth."""
    signature = next(one for one in found[0] if one.effect == "structural_damping")
    size = 0.1 / float(np.linalg.norm(signature.change))
    machine = replace(test.refit.machine, effects=(signature.drawn.sized(size),))
    change = np.sqrt(test.scale) * test.refit.whiten(test.refit.change(machine))
    np.testing.assert_allclose(change, size * signature.change, atol=2e-4)


def test_fewer_lines_leave_a_smaller_gain(test):
    """A fit of every fourth line holds a quarter of the information, and the priors stay."""
    names = {"mass_error": CATALOGUE["mass_error"]}
    whole, few = (find_signatures(one, names, [])[0][0] for one in (test, test.thin(4)))
    power = [one.change @ one.change for one in (whole, few)]
    assert power[1] / power[0] == pytest.approx(test.thin(4).scale / test.scale, rel=1e-3)
    gain = [one.left @ one.left for one in (whole, few)]
    assert gain[0] / 4 < gain[1] < gain[0]


def test_nine_of_ten_verdicts_name_the_effect_at_its_smallest_size(found):
    signatures, information = found
    few = [one for one in signatures if one.effect != "sensor_gain" or "acc11" in one.location]
    verdicts = LinearVerdicts(few, information, WEIGHING, draws=120)
    checked = 0
    for _, numbers in verdicts.families:
        sizes = find_thresholds(verdicts, numbers, verdicts.signatures[numbers[0]].drawn.limits)
        size = float(np.quantile(sizes, 0.9, method="higher"))
        if np.isfinite(size):
            # Other draws of the same machine: 0.9 within three standard deviations.
            fresh = LinearVerdicts(few, information, WEIGHING, draws=120, seed=1)
            rate = fresh.find(numbers, np.full(120, size)).mean()
            assert rate == pytest.approx(0.9, abs=3 * np.sqrt(2 * 0.09 / 120))
            checked += 1
    assert checked >= 4


def test_a_gap_that_more_noise_may_hide_needs_a_larger_size(found):
    signatures, information = found
    alone = [one for one in signatures if one.effect == "structural_damping"][:1]
    usual = predict_smallest(alone, information, WEIGHING)[0].of_usual
    (row,) = predict_smallest(alone, information, replace(WEIGHING, hidden=1e4))
    assert row.of_usual > 1.05 * usual


def test_a_twin_is_never_found(found):
    signatures, information = found
    one = next(one for one in signatures if one.effect == "structural_damping")
    twins = [one, replace(one, effect="viscoelastic")]
    for row in predict_smallest(twins, information, WEIGHING):
        assert not row.is_found
        assert len(row.confused) == 1


def test_a_vector_is_drawn_in_every_direction(test):
    """Signatures add up: that of any direction is the sum of those that were drawn."""
    names = {"joint_coupling": CATALOGUE["joint_coupling"]}
    verdicts = LinearVerdicts(*find_signatures(test, names, []), WEIGHING, draws=50)
    _, numbers = verdicts.families[0]
    weights = verdicts.shapes(numbers)
    drawn = np.array([verdicts.signatures[number].drawn.along for number in numbers])
    directions = weights @ drawn
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-9)
    left = np.array([verdicts.signatures[number].left for number in numbers])
    for direction, weight in list(zip(directions, weights, strict=True))[:3]:
        effect = replace(verdicts.signatures[numbers[0]].drawn, along=tuple(direction.tolist()))
        draws = {"joint_coupling": lambda *_, effect=effect: effect}
        place = verdicts.signatures[numbers[0]].location
        exact = find_signatures(test, draws, [place])[0][0].left
        # Slopes are those of finite sizes.
        assert np.linalg.norm(weight @ left - exact) < 0.1 * np.linalg.norm(exact)


def test_an_effect_on_a_tolerance_shifts_it_by_its_standard_deviations(test):
    tolerance = Tolerances()
    for name, parameter, deviation, count in (
        ("sensor_position", "offset", tolerance.sensor_position, 3),
        ("sensor_gain", "gain", tolerance.sensor_gain, 1),
        ("hammer_misalignment", "rotation", tolerance.hammer_angle, 2),
    ):
        effect = CATALOGUE[name](stream(3, name), test.scene, None)
        shift = shift_of(effect, tolerance)
        value = stated_number(parameter, effect.answer().parameters[parameter])
        expected = abs(value - (parameter == "gain")) / deviation
        assert (shift.count, shift.per_size * effect.size) == (count, pytest.approx(expected))


def test_effects_on_what_has_no_tolerance_are_left_out(test):
    without = list_without_tolerance(Tolerances())
    assert set(without) == {"sensor_delay", "hammer_gain", "hammer_delay"}
    names = {name: CATALOGUE[name] for name in ("sensor_delay", "sensor_gain")}
    signatures, _ = find_signatures(test, names, [])
    assert {one.effect for one in signatures} == {"sensor_gain"}


def test_every_direction_of_a_sensor_has_its_own_size(found):
    directions = {one.dof for one in found[0] if one.location == "sensor:acc11"}
    assert directions == {"tx", "ty", "tz"}


def test_a_size_is_stated_by_the_parameter_that_follows_it(test):
    """The length of an offset; nothing for a body's mode, whose frequency stays."""
    names = ("flexible_body", "joint_coupling")
    signatures, information = find_signatures(test, {name: CATALOGUE[name] for name in names}, [])
    rows = predict_smallest(signatures, information, WEIGHING)
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
