"""Posterior of sets of causes: by hand, and the properties that every verdict relies on."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from diagnosis.decision.established import is_nothing_missing
from diagnosis.inference.calibration import Calibration
from diagnosis.inference.evidence import Evidence, FittedSet, ForceGain
from diagnosis.inference.posterior import (
    Posterior,
    compute_log_odds,
    compute_posterior,
    select_material_sets,
)
from diagnosis.settings import SETTINGS

CONSTANTS = Calibration(
    hidden={"coherence": 0.1, "differences": 0.3, "lines": 0.01},
    hidden_width=0.25,
    error_values=80.0,
    noise_exponent=2.0,
    max_noise_share=0.99,
    tolerance_weight=0.05,
    force_scale=0.04,
)
A, B, C = (("mass_error", f"body:{name}", None) for name in "abc")
TOLERANCE = ("sensor_gain", "sensor:acc1", "tx")
SWAP = ("sensor_swap", "sensor:acc2", "tx+ty")


def fitted(keys, cost, gap, **more):
    """A set of causes with a cost [nats per value] and a gap; a fifth of the variance is noise."""
    numbers = {"noise_share": 0.2, "effective_values": 1000.0, "floor": 0.01} | more
    return FittedSet(
        keys=keys,
        cost=cost,
        values=6000,
        fitted_values=6000,
        chi_square=1 + gap,
        doubt=0.0,
        **numbers,
    )


def evidence(sets=(), gap=10.0, **more):
    """Evidence with a null model of cost zero."""
    numbers = {"hypotheses": 50, "variance": "coherence"} | more
    forces = tuple(
        ForceGain(location=f"joint:{k}", dof=None, gain=100.0 / (k + 1)) for k in range(3)
    )
    return Evidence(null=fitted((), 0.0, gap), sets=tuple(sets), pushed=forces, **numbers)


def total(posterior):
    return posterior.none + posterior.unexplained + sum(share for _, share in posterior.sets)


def test_the_log_odds_of_a_set_are_those_computed_by_hand():
    first = fitted((A,), -2.0, 5.0, parameters=(4,), prior=-30.0)
    both = fitted((A, B), -3.0, 4.0, parameters=(4, 15))  # 1 / chi square is the noise share
    logs = compute_log_odds(evidence(), [first, both], CONSTANTS)
    count = 1 / (0.2**2 / 6000 + (1 - 0.2**2) / 80.0)  # at the noise share of the best set
    expected = [
        count * 2.0 + 0.05 * 30 - 4 / 2 - np.log(50),
        count * 3.0 - 19 / 2 - 2 * np.log(50),
    ]
    np.testing.assert_allclose(logs, expected)


def test_an_improbable_set_does_not_say_how_many_values_are_independent():
    # Three causes leave noise alone, but gain less than they pay; one cause leaves an error.
    single = fitted((A,), -0.004, 8.0, noise_share=0.1)
    three = fitted((A, B, C), -0.005, 0.02, noise_share=0.98)
    assert three.count_independent(CONSTANTS) > 1000
    price = np.log(50)
    logs = compute_log_odds(evidence(), [single, three], CONSTANTS)
    count = single.count_independent(CONSTANTS)
    assert logs == pytest.approx([0.004 * count - price, 0.005 * count - 3 * price])
    # Where these three gain what they pay, the noise of their residual counts.
    three = three.model_copy(update={"cost": -3.0})
    logs = compute_log_odds(evidence(), [single, three], CONSTANTS)
    assert logs[1] == pytest.approx(3.0 * three.count_independent(CONSTANTS) - 3 * price)


def test_what_differs_between_levels_counts_beside_the_rest():
    law = fitted((A,), -2.0, 5.0, level_excess=0.5, noise_share=0.9)
    gain = fitted((B,), -2.0, 5.0, level_excess=9.0, noise_share=0.9)
    unknown = fitted((C,), -2.0, 5.0, noise_share=0.9)
    of_null = {"null": fitted((), 0.0, 10.0, level_excess=9.0)}
    logs = compute_log_odds(evidence().model_copy(update=of_null), [law, gain, unknown], CONSTANTS)
    without = compute_log_odds(evidence(), [law, gain, unknown], CONSTANTS)
    count = 1 / ((1 / 1.5) ** 2 / 6000 + (1 - (1 / 1.5) ** 2) / 80.0)
    np.testing.assert_allclose(logs - without, [count * np.log(10 / 1.5), 0.0, 0.0])


def test_a_dependence_that_a_badly_known_variance_explains_counts_as_none():
    null, law = (
        fitted(keys, 0.0, 10.0, level_excess=excess).model_copy(update={"doubt": 0.3})
        for keys, excess in (((), 0.25), ((A,), -0.1))
    )
    assert law.gain_between_levels(null, law, CONSTANTS) == 0.0


def test_noise_is_independent_and_model_error_is_shared():
    nearly = CONSTANTS.count_independent(0.99, 6000)
    assert nearly == pytest.approx(1 / (0.99**2 / 6000 + (1 - 0.99**2) / 80))
    assert CONSTANTS.count_independent(1.0, 6000) == nearly
    assert CONSTANTS.count_independent(0.0, 6000) == pytest.approx(80)
    # Kish: n / (1 + (m - 1) rho) with clusters of m = n / n_e values and correlation rho.
    exact = 6000 / (1 + (6000 / 80 - 1) * (1 - 0.3**2))
    assert CONSTANTS.count_independent(0.3, 6000) == pytest.approx(exact, rel=0.01)


def test_a_badly_known_variance_is_no_model_error():
    """Lines beside each other share nothing: the residual is noise that is larger than stated."""
    share = 0.9
    certain = fitted((A,), -2.0, 0.2, noise_share=share)
    doubtful = certain.model_copy(update={"serial": 0.0, "doubt": 0.2})
    assert certain.count_independent(CONSTANTS) == CONSTANTS.count_independent(share, 6000)
    assert doubtful.count_independent(CONSTANTS) == CONSTANTS.count_independent(1.0, 6000)
    with_gap = doubtful.model_copy(update={"serial": 0.06})
    expected = CONSTANTS.count_independent(1 - 0.06 / 1.2, 6000)
    assert with_gap.count_independent(CONSTANTS) == pytest.approx(expected)


def test_the_cost_of_tolerances_counts_by_its_weight():
    free, shifted = fitted((A,), -2.0, 5.0), fitted((B,), -2.0, 5.0, prior=60.0)
    first, second = compute_log_odds(evidence(), [free, shifted], CONSTANTS)
    assert first - second == pytest.approx(0.05 * 60.0)


def test_the_cost_of_tolerances_counts_no_less_than_in_fits_of_few_values():
    free, shifted = (
        fitted((key,), -2.0, 5.0, prior=prior).model_copy(update={"fitted_values": 400})
        for key, prior in ((A, 0.0), (B, 60.0))
    )
    first, second = compute_log_odds(evidence(), [free, shifted], CONSTANTS)
    count = free.count_independent(CONSTANTS)
    assert count / 400 > CONSTANTS.tolerance_weight
    assert first - second == pytest.approx(count / 400 * 60.0)


def test_sets_of_the_same_effects_have_as_many_parameters_wherever_they_act():
    here, there = ("appendage", "body:a", "tx"), ("appendage", "body:b", "tx")
    rows = [fitted((key,), -2.0, 5.0, parameters=(n,)) for key, n in ((here, 9), (there, 10))]
    first, second = compute_log_odds(evidence(sets=tuple(rows)), rows, CONSTANTS)
    assert first == pytest.approx(second)
    (alone,) = compute_log_odds(evidence(), rows[:1], CONSTANTS)
    assert alone == pytest.approx(first + 0.5)


def test_log_odds_of_no_set_are_an_empty_array():
    assert compute_log_odds(evidence(), [], CONSTANTS).shape == (0,)


def test_the_odds_of_none_are_the_power_of_what_may_be_hidden_over_the_gap():
    for gap in (0.05, 0.1, 0.2):
        posterior = compute_posterior(evidence(gap=gap), CONSTANTS)
        odds = posterior.none / posterior.unexplained
        assert odds == pytest.approx((0.1 / gap) ** (1 / 0.25), rel=1e-3)


@given(
    gap=some.floats(1e-3, 1e3),
    costs=some.lists(some.floats(-5.0, 5.0), min_size=1, max_size=4),
    both=some.floats(-5.0, 5.0),
    unsteady=some.integers(0, 2),
)
def test_probabilities_of_none_unexplained_and_all_sets_sum_to_one(gap, costs, both, unsteady):
    sets = [
        fitted((key,), cost, 0.0) for key, cost in zip((A, B, C, TOLERANCE), costs, strict=False)
    ]
    sets.append(fitted((A, B), both, 0.0))
    posterior = compute_posterior(evidence(sets, gap, unsteady=unsteady), CONSTANTS)
    assert total(posterior) == pytest.approx(1.0, abs=1e-4)
    assert min(posterior.none, posterior.unexplained) > 0
    assert sum(share for _, share in posterior.where) == pytest.approx(1.0)
    several = sum(share for keys, share in posterior.sets if len(keys) > 1)
    assert posterior.several == pytest.approx(several)


def test_a_cause_is_present_with_the_sum_of_its_sets():
    sets = [fitted((A,), -2.0, 3.0), fitted((B,), -1.999, 3.0), fitted((A, B), -2.5, 0.0)]
    posterior = compute_posterior(evidence(sets), CONSTANTS)
    shares = dict(posterior.sets)
    presence = dict(posterior.causes)
    assert presence[A] == pytest.approx(shares[A,] + shares[A, B])
    assert presence[B] == pytest.approx(shares[B,] + shares[A, B])


def test_the_same_causes_fitted_twice_are_one_set_the_better():
    once = compute_posterior(
        evidence([fitted((A,), -2.0, 0.0), fitted((B,), -2.0, 0.0)]), CONSTANTS
    )
    again = compute_posterior(
        evidence([fitted((A,), -2.0, 0.0), fitted((A,), -2.0, 0.0), fitted((B,), -2.0, 0.0)]),
        CONSTANTS,
    )
    assert again.sets == once.sets


def test_a_cause_that_closes_less_than_a_fifth_is_not_material():
    null = fitted((), 0.0, 10.0)
    little = fitted((A,), -1.0, 8.1)
    enough = fitted((B,), -1.0, 7.9)
    most = fitted((C,), -1.0, 1.9)
    beside = fitted((B, C), -1.5, 5.5)
    rest = fitted((C, A), -2.0, 1.6)
    material = select_material_sets(null, [little, enough, most, beside, rest], SETTINGS)
    # C closes enough beside B, but B closes nothing beside C, whichever came last.
    assert [fitted_set.keys for fitted_set in material] == [(B,), (C,)]


def test_both_causes_of_a_material_pair_close_a_fifth_beside_each_other():
    null = fitted((), 0.0, 10.0)
    alone = [fitted((A,), -1.0, 6.0), fitted((B,), -1.0, 5.0)]
    pair = fitted((A, B), -2.0, 2.0)
    material = select_material_sets(null, [*alone, pair], SETTINGS)
    assert [fitted_set.keys for fitted_set in material] == [(A,), (B,), (A, B)]


def test_a_weak_cause_beside_a_strong_one_is_material_if_it_closes_a_fifth_of_the_rest():
    null = fitted((), 0.0, 300.0)
    strong = fitted((A,), -1.0, 20.0)
    weak = fitted((A, B), -3.0, 0.1)
    small_error = fitted((A, C), -2.0, 16.1)
    beside_nothing = fitted((A, B, C), -3.1, 0.0)  # no gap was visible before
    material = select_material_sets(null, [strong, weak, small_error, beside_nothing], SETTINGS)
    assert [fitted_set.keys for fitted_set in material] == [(A,), (A, B)]


def test_outliers_of_tolerances_are_no_causes_and_explain_what_they_close():
    shifted = fitted((TOLERANCE,), -3.0, 0.01, shifts=(4.0,))
    posterior = compute_posterior(evidence([shifted]), CONSTANTS)
    assert posterior.causes == ()
    assert posterior.none > 0.9
    broken = fitted((TOLERANCE,), -3.0, 0.01, shifts=(9.0,))
    assert compute_posterior(evidence([broken]), CONSTANTS).causes[0][0] == TOLERANCE
    # Beside a true cause an outlier makes no second one.
    pair = fitted((A, TOLERANCE), -3.5, 0.0, shifts=(None, 4.0))
    posterior = compute_posterior(evidence([fitted((A,), -2.0, 0.5), pair]), CONSTANTS)
    assert [key for key, _ in posterior.causes] == [A]


def test_proven_faults_are_present_with_certainty_and_others_beside_them():
    posterior = compute_posterior(evidence([fitted((A,), -2.0, 0.0)], proven=(SWAP,)), CONSTANTS)
    presence = dict(posterior.causes)
    assert presence[SWAP] == pytest.approx(1.0, abs=1e-3)
    assert presence[A] > 0.9
    assert posterior.several > 0.9
    assert total(posterior) == pytest.approx(1.0, abs=1e-3)


def test_a_sensor_that_is_wrong_by_no_known_fault_leaves_nothing_to_none():
    posterior = compute_posterior(evidence(gap=0.01, unknown=("sensor:acc9",)), CONSTANTS)
    assert posterior.none < 1e-3
    assert posterior.unexplained > 0.99
    assert posterior.where[0] == ("sensor:acc9", pytest.approx(1.0))


def test_no_probability_exceeds_one_where_all_is_unexplained():
    """The least probability of nothing missing goes to the rest, or to a proven fault."""
    for further in ({"unknown": ("acc1",)}, {"proven": (("sensor_swap", "sensor:acc1", None),)}):
        posterior = compute_posterior(evidence(gap=1e9, **further), CONSTANTS)
        assert posterior.unexplained <= 1.0
        assert all(probability <= 1.0 for _, probability in posterior.causes)


def test_hits_that_met_different_machines_make_none_no_more_probable_than_unexplained():
    steady = compute_posterior(evidence(gap=0.01), CONSTANTS)
    unsteady = compute_posterior(evidence(gap=0.01, unsteady=1), CONSTANTS)
    assert steady.none > 0.99
    assert unsteady.none == pytest.approx(0.5)


def test_a_gap_that_is_not_significant_is_none_though_hits_differ_and_causes_take_a_little():
    weak = fitted((A,), -0.0005, 0.005)
    unsteady = compute_posterior(evidence([weak], gap=0.01, unsteady=1), CONSTANTS)
    assert unsteady.none == unsteady.unexplained < 0.5
    assert is_nothing_missing(unsteady)
    assert not is_nothing_missing(compute_posterior(evidence([weak], unsteady=1), CONSTANTS))
    # Where a cause is there, but the data do not tell which, something is missing.
    assert not is_nothing_missing(Posterior(0.3, 0.2, 0.0, (), ()))


def test_one_effect_at_one_place_in_two_directions_is_one_cause():
    turned = (*TOLERANCE[:2], "ty")
    sets = [fitted((TOLERANCE,), -2.0, 5.0), fitted((TOLERANCE, turned), -3.0, 0.0)]
    posterior = compute_posterior(evidence(sets), CONSTANTS)
    ((key, probability),) = posterior.causes
    assert key[:2] == TOLERANCE[:2]
    assert probability > 0.9
    assert posterior.several == 0


def test_causes_within_three_nats_of_each_other_are_confounded():
    turned = ("mass_error", "body:b", "x")
    rows = (((A,), 0.6), ((B,), 0.02), ((turned,), 0.02), ((C,), 0.025), ((TOLERANCE,), 0.003))
    posterior = Posterior(0.1, 0.1, 0.0, (), (), rows)
    # 0.6 to 0.04, two directions of one cause, but not to 0.025; 0.003 is not worth a row.
    assert posterior.find_confounded_pairs() == ((A[:2], B[:2]), (B[:2], C[:2]))
    # What is present at once is no alternative; what is present beside the same is.
    both = (((A, B), 0.5), ((A, C), 0.4), ((B,), 0.05))
    assert Posterior(0.1, 0.1, 0.9, (), (), both).find_confounded_pairs() == ((B[:2], C[:2]),)


def one_effect(*costs, gap=5.0, **more):
    """Posterior of one effect at the bodies a, b, c, each with its cost [nats per value]."""
    sets = [fitted((key,), cost, gap) for key, cost in zip((A, B, C), costs, strict=False)]
    return compute_posterior(evidence([*sets, *more.pop("sets", ())], **more), CONSTANTS)


def test_one_effect_at_places_that_the_test_cannot_tell_apart_is_one_cause():
    pair = (A[:2], B[:2])
    apart = dict(one_effect(-0.20, -0.21, -0.17).causes)
    posterior = one_effect(-0.20, -0.21, -0.17, interchangeable=(pair,))
    (key, probability), *others = posterior.causes
    assert key == B  # the likeliest place
    assert probability == pytest.approx(apart[A] + apart[B])
    assert posterior.list_places(B) == ["body:b", "body:a"]
    assert [row[0] for row in others] == [C]
    assert posterior.list_places(C) == ["body:c"]
    # Each place keeps its share of where the cause is.
    shares = dict(posterior.where)
    assert shares["body:a"] / shares["body:b"] == pytest.approx(apart[A] / apart[B])
    assert dict(posterior.apart) == pytest.approx(apart)


def test_every_pair_of_places_of_one_cause_is_alike_and_within_three_nats():
    costs = (-0.22, -0.21, -0.20)
    two = one_effect(*costs, interchangeable=((A[:2], B[:2]), (B[:2], C[:2])))
    assert two.groups == ((A[:2], B[:2]),)  # A and C are not alike
    pairs = ((A[:2], B[:2]), (B[:2], C[:2]), (A[:2], C[:2]))
    assert one_effect(*costs, interchangeable=pairs).groups == ((A[:2], B[:2], C[:2]),)
    far = one_effect(-0.3, -0.2, interchangeable=pairs)  # about 80 values: 8 nats
    assert far.groups == ()


def test_places_that_the_most_probable_set_holds_together_are_two_causes():
    both = fitted((A, B), -0.6, 0.0)
    posterior = one_effect(-0.2, -0.2, sets=[both], interchangeable=((A[:2], B[:2]),))
    assert posterior.groups == ()
    assert posterior.several > 0.9


def test_a_fault_that_redundant_channels_prove_pays_for_its_parameters_alone():
    alone = fitted((A,), -0.1, 5.0, parameters=(6,))
    beside = fitted((A, B), -0.6, 4.0, parameters=(6, 3))
    logs = compute_log_odds(evidence(small_faults=(A,)), [alone, beside], CONSTANTS)
    count = CONSTANTS.count_independent(0.2, 6000)
    np.testing.assert_allclose(logs, [count * 0.1 - 6 / 2, count * 0.6 - 9 / 2 - np.log(50)])
    sets = [fitted((A,), -0.1, 5.0, parameters=(8,))]
    assert dict(compute_posterior(evidence(sets), CONSTANTS).causes)[A] < 0.7
    proven = compute_posterior(evidence(sets, small_faults=(A,)), CONSTANTS)
    assert dict(proven.causes)[A] > 0.98


def test_sets_that_contain_a_rejected_one_do_not_count():
    sets = [fitted((A,), -3.0, 0.0), fitted((B,), -2.0, 0.5), fitted((B, A), -4.0, 0.0)]
    assert dict(compute_posterior(evidence(sets), CONSTANTS).causes)[A] > 0.99
    posterior = compute_posterior(evidence(sets, rejected=((A,),)), CONSTANTS)
    assert [keys for keys, _ in posterior.sets] == [(B,)]


def test_the_first_cause_of_a_gap_that_noise_nearly_hides_is_material():
    null, alone = fitted((), 0.0, 0.05), fitted((A,), -1.0, 0.01)
    assert select_material_sets(null, [alone], SETTINGS) == [alone]
    pair = fitted((A, B), -2.0, 0.0)  # what A leaves is not visible
    assert select_material_sets(null, [alone, pair], SETTINGS) == [alone]


def test_two_causes_are_material_if_each_leaves_less_than_is_visible():
    null, alone = fitted((), 0.0, 0.45), fitted((A,), -1.0, 0.2)
    both, little = fitted((A, B), -2.0, 0.03), fitted((A, C), -1.2, 0.15)  # of 0.45: 38 and 11 %
    assert select_material_sets(null, [alone, both, little], SETTINGS) == [alone, both]
