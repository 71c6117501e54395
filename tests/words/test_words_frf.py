"""Labelled FRFs: what they refuse, selection by label, quantities, estimates."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.words import (
    DERIVATIVE_ORDER,
    DIRECTIONS,
    Dof,
    Frf,
    FrfEstimate,
    UsageError,
    frozen_array,
)

FREQ = np.array([0.5, 2.0, 3.0, 7.0, 11.0])
OUTPUTS = tuple(map(Dof.parse, ["acc1:+tx", "acc1:-ty", "acc2:+rz", "ty:-rx"]))
INPUTS = tuple(map(Dof.parse, ["hit3:+tz", "acc2:-tx", "acc1:+tx"]))


def an_frf(**changed):
    """5 lines, 4 outputs, 3 inputs, all 60 numbers different."""
    rng = np.random.default_rng(2)
    values = rng.normal(size=(5, 4, 3)) + 1j * rng.normal(size=(5, 4, 3))
    fields = {
        "freq_hz": FREQ,
        "values": values,
        "outputs": OUTPUTS,
        "inputs": INPUTS,
        "quantity": "mobility",
    }
    return Frf(**{**fields, **changed})


def an_estimate(**changed):
    frf = an_frf()
    rng = np.random.default_rng(3)
    shape = frf.values.shape
    fields = {
        "frf": frf,
        "variance": rng.uniform(1, 2, shape),
        "variance_source": "coherence",
        "measured": np.ones(shape[1:], bool),
        "coherence": rng.uniform(0.1, 1, shape),
        "averages": 10,
    }
    return FrfEstimate(**{**fields, **changed})


def spoilt(array, value):
    copy = np.array(array)
    copy.flat[7 % copy.size] = value
    return copy


@pytest.mark.parametrize(
    ("freq", "message"),
    [
        ([0.5, 2.0, 3.0, np.nan, 11.0], r"freq_hz is not finite at index \(3,\)"),
        ([0.5, 2.0, 3.0, 7.0, np.inf], "freq_hz is not finite"),
        ([0.5, 3.0, 2.0, 7.0, 11.0], "strictly increasing"),
        ([0.5, 2.0, 2.0, 7.0, 11.0], "strictly increasing"),
        ([-0.5, 2.0, 3.0, 7.0, 11.0], "not negative"),
        ([[0.5, 2.0, 3.0, 7.0, 11.0]], r"freq_hz has shape \(1, 5\), expected \(n\)"),
        (3.0, "freq_hz has shape"),
    ],
)
def test_frequencies_that_are_no_axis_are_refused(freq, message):
    with pytest.raises(ValueError, match=message):
        an_frf(freq_hz=freq)


def test_an_frf_without_lines_is_refused():
    with pytest.raises(ValueError, match="non-empty"):
        an_frf(freq_hz=[], values=np.zeros((0, 4, 3)))


@pytest.mark.parametrize("bad", [np.nan, np.inf, complex(0, np.nan), complex(1, -np.inf)])
def test_a_value_that_is_not_finite_is_refused_with_its_place(bad):
    with pytest.raises(ValueError, match=r"values is not finite at index \(0, 2, 1\)"):
        an_frf(values=spoilt(an_frf().values, bad))


@pytest.mark.parametrize("shape", [(5, 3, 4), (4, 5, 3), (3, 4, 5), (5, 12), (5, 4, 3, 1), (60,)])
def test_values_in_another_shape_are_refused(shape):
    with pytest.raises(ValueError, match=r"expected \(5, 4, 3\)"):
        an_frf(values=an_frf().values.reshape(shape))


@pytest.mark.parametrize("again", ["acc1:+tx", "acc1:-tx"])
@pytest.mark.parametrize(("side", "labels"), [("outputs", OUTPUTS), ("inputs", INPUTS)])
def test_a_label_that_comes_twice_is_refused_also_with_the_opposite_sign(side, labels, again):
    kept = [dof for dof in labels if str(dof) != "acc1:+tx"][: len(labels) - 2]
    twice = (Dof.parse("acc1:+tx"), *kept, Dof.parse(again))
    with pytest.raises(ValueError, match=f"an {side[:-1]} appears twice: acc1:"):
        an_frf(**{side: twice})


def test_an_unknown_quantity_is_refused():
    with pytest.raises(ValueError, match="'inertance' is none of receptance, mobility"):
        an_frf(quantity="inertance")


def test_one_label_may_be_output_and_input():
    assert OUTPUTS[0] in an_frf().inputs


def test_arrays_are_copied():
    freq, values = FREQ.copy(), an_frf().values.copy()
    frf = an_frf(freq_hz=freq, values=values)
    freq[0], values[0, 0, 0] = 0.1, 99
    assert frf.freq_hz[0] == 0.5
    assert frf.values[0, 0, 0] != 99


@pytest.mark.parametrize("name", ["freq_hz", "values"])
def test_arrays_of_an_frf_are_read_only(name):
    with pytest.raises(ValueError, match="read-only"):
        getattr(an_frf(), name)[...] = 0


@pytest.mark.parametrize("name", ["variance", "coherence", "measured"])
def test_arrays_of_an_estimate_are_read_only(name):
    with pytest.raises(ValueError, match="read-only"):
        getattr(an_estimate(), name)[...] = 0


def test_a_field_cannot_be_exchanged():
    with pytest.raises(AttributeError):
        an_frf().quantity = "receptance"


def test_labels_given_as_lists_become_tuples():
    frf = an_frf(outputs=list(OUTPUTS), inputs=list(INPUTS))
    assert (frf.outputs, frf.inputs) == (OUTPUTS, INPUTS)


def test_a_frozen_array_is_not_copied_again():
    first = frozen_array(np.arange(6.0).reshape(2, 3), np.float64, (2, 3), "it")
    again = frozen_array(first[:, 1:], np.float64, (2, 2), "it")
    assert np.shares_memory(first, again)


def test_an_array_that_somebody_can_write_to_is_copied():
    owner = np.arange(6.0)
    view = owner[:4]
    view.flags.writeable = False
    frozen = frozen_array(view, np.float64, (4,), "it")
    owner[:] = -1.0
    np.testing.assert_array_equal(frozen, [0, 1, 2, 3])


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 2e30])
@pytest.mark.parametrize("kind", [np.float64, np.complex128])
def test_a_value_that_is_not_finite_or_too_large_is_refused(kind, wrong):
    values = np.ones((3, 2), kind)
    values[1, 0] = wrong if kind is np.float64 else 1 + 1j * wrong
    with pytest.raises(ValueError, match=r"it is .* at index \(1, 0\)"):
        frozen_array(values, kind, (3, 2), "it", 1e30)


def test_a_frozen_array_keeps_what_it_was_given():
    given = [[1.0, 2.0], [3.0, 4.0]]
    np.testing.assert_array_equal(frozen_array(given, np.float64, (2, None), "it"), given)


def test_selecting_takes_the_cell_of_its_labels():
    frf = an_frf()
    one = frf.select([OUTPUTS[2]], [INPUTS[1]])
    np.testing.assert_array_equal(one.values[:, 0, 0], frf.values[:, 2, 1])


def test_selecting_the_opposite_output_turns_the_sign():
    frf = an_frf()
    turned = frf.select([Dof.parse("acc1:+ty"), Dof.parse("acc1:-tx")], INPUTS)
    np.testing.assert_array_equal(turned.values[:, 0], -frf.values[:, 1])
    np.testing.assert_array_equal(turned.values[:, 1], -frf.values[:, 0])


def test_selecting_both_ends_opposite_keeps_the_sign():
    frf = an_frf()
    turned = frf.select([Dof.parse("acc1:-tx")], [Dof.parse("hit3:-tz")])
    np.testing.assert_array_equal(turned.values[:, 0, 0], frf.values[:, 0, 0])


def test_selected_labels_are_those_asked_for():
    asked = (Dof.parse("ty:+rx"), Dof.parse("acc1:-ty"))
    chosen = an_frf().select(asked, INPUTS[::-1])
    assert (chosen.outputs, chosen.inputs) == (asked, INPUTS[::-1])


def flipped(labels, flips):
    return [
        Dof.of(dof.point, dof.axis, -dof.sign if flip else dof.sign)
        for dof, flip in zip(labels, flips, strict=True)
    ]


def relabelled(labels):
    """A permutation of the labels, some of them with the opposite sign."""
    return st.tuples(
        st.permutations(labels), st.lists(st.booleans(), min_size=len(labels), max_size=len(labels))
    ).map(lambda pair: flipped(*pair))


@given(relabelled(OUTPUTS), relabelled(INPUTS))
def test_selecting_there_and_back_changes_nothing(outputs, inputs):
    frf = an_frf()
    back = frf.select(outputs, inputs).select(frf.outputs, frf.inputs)
    np.testing.assert_array_equal(back.values, frf.values)


@given(relabelled(OUTPUTS), relabelled(INPUTS))
def test_every_selected_cell_is_the_labelled_one_times_both_signs(outputs, inputs):
    frf = an_frf()
    chosen = frf.select(outputs, inputs)
    table = {
        (o.point, o.axis, i.point, i.axis): o.sign * i.sign * frf.values[:, a, b]
        for a, o in enumerate(OUTPUTS)
        for b, i in enumerate(INPUTS)
    }
    for a, o in enumerate(outputs):
        for b, i in enumerate(inputs):
            expected = o.sign * i.sign * table[o.point, o.axis, i.point, i.axis]
            np.testing.assert_array_equal(chosen.values[:, a, b], expected)


@pytest.mark.parametrize("missing", ["acc9:+tx", "acc1:+tz", "acc1:+rx", "Acc1:+tx"])
def test_a_label_that_is_not_there_is_named(missing):
    with pytest.raises(UsageError, match=missing.replace("+", r"\+")):
        an_frf().select([OUTPUTS[0], Dof.parse(missing)], INPUTS)
    with pytest.raises(UsageError, match="inputs"):
        an_frf().select(OUTPUTS, [Dof.parse(missing)])


@pytest.mark.parametrize("chosen", [slice(1, 4), np.array([False, True, True, True, False])])
def test_lines_are_kept_with_their_frequency(chosen):
    frf = an_frf()
    kept = frf.select_lines(chosen)
    np.testing.assert_array_equal(kept.freq_hz, [2.0, 3.0, 7.0])
    np.testing.assert_array_equal(kept.values, frf.values[1:4])


@pytest.mark.parametrize(
    ("start", "end", "power"),
    [
        ("receptance", "mobility", 1),
        ("mobility", "accelerance", 1),
        ("receptance", "accelerance", 2),
        ("accelerance", "receptance", -2),
        ("accelerance", "mobility", -1),
        ("mobility", "mobility", 0),
    ],
)
def test_a_quantity_differs_by_powers_of_i_omega(start, end, power):
    frf = an_frf(quantity=start)
    converted = frf.as_quantity(end)
    expected = frf.values * (2j * np.pi * FREQ[:, None, None]) ** power
    assert converted.quantity == end
    # Both sides are one power and one product: a few roundings.
    np.testing.assert_allclose(converted.values, expected, rtol=1e-15)


@given(st.sampled_from(list(DERIVATIVE_ORDER)), st.sampled_from(list(DERIVATIVE_ORDER)))
def test_a_quantity_there_and_back_is_the_same(start, end):
    frf = an_frf(quantity=start)
    back = frf.as_quantity(end).as_quantity(start)
    assert back.quantity == start
    # Two products with powers up to 2 that each round a few times.
    np.testing.assert_allclose(back.values, frf.values, rtol=1e-14)


def test_an_acceleration_leads_its_displacement_by_half_a_turn():
    # exp(+i w t): x'' = -w^2 x. Another sign of time would pass too, so mobility is checked beside.
    frf = an_frf(values=np.ones((5, 4, 3)), quantity="receptance")
    assert (frf.as_quantity("accelerance").values.real < 0).all()
    assert (frf.as_quantity("mobility").values.imag > 0).all()


def test_integrating_at_0_hz_is_refused_with_the_remedy():
    frf = an_frf(freq_hz=FREQ - 0.5)
    with pytest.raises(UsageError, match="mobility at 0 Hz has no receptance: drop the line"):
        frf.as_quantity("receptance")


def test_differentiating_at_0_hz_gives_zero():
    frf = an_frf(freq_hz=FREQ - 0.5)
    assert not frf.as_quantity("accelerance").values[0].any()


def test_keeping_the_quantity_at_0_hz_is_allowed():
    frf = an_frf(freq_hz=FREQ - 0.5)
    np.testing.assert_array_equal(frf.as_quantity("mobility").values, frf.values)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"variance": np.ones((5, 3, 4))}, r"variance has shape \(5, 3, 4\)"),
        ({"variance": spoilt(np.ones((5, 4, 3)), -1e-9)}, "variance is negative"),
        ({"variance": spoilt(np.ones((5, 4, 3)), np.nan)}, "variance is not finite"),
        ({"variance": spoilt(np.ones((5, 4, 3)), np.inf)}, "variance is not finite"),
        ({"measured": np.ones((3, 4), bool)}, r"measured has shape \(3, 4\)"),
        ({"coherence": np.ones((5, 4))}, "coherence has shape"),
        ({"coherence": spoilt(np.ones((5, 4, 3)), 1.0001)}, r"coherence is outside 0\.\.1"),
        ({"coherence": spoilt(np.ones((5, 4, 3)), -0.1)}, r"coherence is outside 0\.\.1"),
        ({"coherence": spoilt(np.ones((5, 4, 3)), np.nan)}, "coherence is not finite"),
        ({"averages": 0}, "averages is 0, expected a whole number from 1"),
        ({"averages": -3}, "averages is -3"),
        ({"window_tau": -0.1}, "window_tau is -0.1 s"),
        ({"window_tau": np.nan}, "window_tau is nan s"),
    ],
)
def test_an_estimate_that_contradicts_itself_is_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        an_estimate(**changed)


def test_an_estimate_may_lack_coherence_and_averages():
    estimate = an_estimate(coherence=None, averages=None, variance_source="differences")
    assert estimate.coherence is None
    assert estimate.select_lines(slice(2, 4)).coherence is None


@pytest.mark.parametrize("chosen", [slice(1, 4), np.array([False, True, True, True, False])])
def test_lines_of_an_estimate_keep_their_variance_and_coherence(chosen):
    whole = an_estimate()
    kept = whole.select_lines(chosen)
    np.testing.assert_array_equal(kept.frf.values, whole.frf.values[1:4])
    np.testing.assert_array_equal(kept.variance, whole.variance[1:4])
    np.testing.assert_array_equal(kept.coherence, whole.coherence[1:4])
    np.testing.assert_array_equal(kept.measured, whole.measured)


def test_outputs_of_an_estimate_keep_order_variance_coherence_and_cells():
    whole, rows = an_estimate(measured=np.arange(12).reshape(4, 3) % 5 > 0), [3, 0, 1]
    chosen = whole.select_outputs(rows)
    assert chosen.frf.outputs == tuple(OUTPUTS[row] for row in rows)
    np.testing.assert_array_equal(chosen.measured, whole.measured[rows])
    for name in ("variance", "coherence"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(whole, name)[:, rows])
    np.testing.assert_array_equal(chosen.frf.values, whole.frf.values[:, rows])
    assert whole.select_outputs(range(4)) is whole
    assert an_estimate(coherence=None).select_outputs([2]).coherence is None


def test_changing_a_copy_validates_again():
    with pytest.raises(ValueError, match="values has shape"):
        replace(an_frf(), outputs=OUTPUTS[:3])


def test_directions_are_the_six_of_a_solid_body():
    assert DIRECTIONS == ("tx", "ty", "tz", "rx", "ry", "rz")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"variance_source": "guess"}, "variance_source is 'guess'"),
        ({"averages": np.nan}, "whole number"),
        ({"averages": 2.5}, "whole number"),
        ({"averages": 0}, "whole number"),
    ],
)
def test_an_estimate_without_sense_is_refused_when_built(changes, said):
    frf = Frf([1.0], [[[1.0]]], (Dof("a", "+tx"),), (Dof("a", "+tx"),), "accelerance")
    arguments = {"variance": [[[1.0]]], "variance_source": "coherence", "measured": [[True]]}
    with pytest.raises(ValueError, match=said):
        FrfEstimate(frf, **{**arguments, **changes})


def test_labels_that_are_no_labels_are_refused_when_built():
    with pytest.raises(ValueError, match="expected a Dof or a Signal"):
        Frf([1.0], [[[1.0]]], ("a:+tx",), (Dof("a", "+tx"),), "accelerance")
