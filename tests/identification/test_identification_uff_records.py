"""Time records out of universal files: ends, signs, units, which channels belong together."""

from dataclasses import replace

import numpy as np
import pytest
from hammer_records import channel_functions
from identification_examples import Function, dataset, numbers, units

from identification.readers.uff_records import holds_uff_time_records, read_uff_records
from identification.words import Dof, InputError, Records

RATE = 2048.0  # its step has eight digits, of which a header keeps six


@pytest.fixture
def file(tmp_path):
    def write(*blocks):
        path = tmp_path / "hits.uff"
        path.write_bytes(b"".join(b if isinstance(b, bytes) else b.content() for b in blocks))
        return path

    return write


@pytest.fixture
def read(file):
    return lambda *blocks, **options: read_uff_records(file(*blocks), **options)


@pytest.fixture
def refusal(read):
    def message(*blocks, **options):
        with pytest.raises(InputError) as caught:
            read(*blocks, **options)
        assert "hits.uff" in str(caught.value)
        return str(caught.value)

    return message


def some(seed=1, *, hits=3, outputs=("7:+x", "2:-y"), reference="11:+z", samples=48):
    return Records(
        RATE,
        numbers(seed, (hits, samples), real=True),
        numbers(seed + 50, (hits, len(outputs), samples), real=True),
        tuple(Dof.parse(text) for text in outputs),
        Dof.parse(reference),
        "accelerance",
    )


def equal(found, expected, rtol=1e-11):
    assert (found.outputs, found.reference) == (expected.outputs, expected.reference)
    assert (found.rate_hz, found.quantity) == (expected.rate_hz, expected.quantity)
    np.testing.assert_allclose(found.force, expected.force, rtol=rtol)
    np.testing.assert_allclose(found.motion, expected.motion, rtol=rtol)


@pytest.mark.parametrize("order", ["", "<", ">"], ids=["ascii", "little", "big"])
@pytest.mark.parametrize("single", [True, False], ids=["single", "double"])
@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
def test_every_form_gives_the_same_records(read, order, single, even):
    records = some()
    (found,) = read(*channel_functions(records, order=order, single=single, even=even))
    if not even:  # a text of six digits, or single precision, has the samples off their clock
        assert found.rate_hz == pytest.approx(RATE, rel=1e-4)
        found = replace(found, rate_hz=RATE)
    equal(found, records, rtol=6e-6 if single else 6e-12)


def test_the_rate_is_the_one_that_six_digits_stand_for(read):
    for rate in (2048.0, 51200.0, 409.6, 1260.0, 6553.6):
        (found,) = read(*channel_functions(replace(some(), rate_hz=rate)))
        assert found.rate_hz == rate


def test_a_file_holds_records_if_it_has_no_frf(file):
    frf = Function(numbers(1))
    records = channel_functions(some())
    assert holds_uff_time_records(file(*records))
    assert not holds_uff_time_records(file(*records, frf))
    assert not holds_uff_time_records(file(frf))
    assert holds_uff_time_records(file(units(1.0, 1.0), *channel_functions(some(), order="<")))


def test_motions_without_a_reference_take_the_place_of_their_force(read):
    records = some()
    (found,) = read(*channel_functions(records, node_of_reference=False))
    equal(found, records)


def test_each_place_of_the_hammer_makes_records_of_its_own(read):
    first, second = some(1), some(9, reference="3:-x", hits=2)
    found = read(*channel_functions(first), *channel_functions(second))
    equal(found[0], first)
    equal(found[1], second)


def test_places_without_reference_are_told_by_their_forces_in_order(read):
    first, second = some(1), some(9, reference="3:-x", hits=2)
    functions = [
        *channel_functions(first, node_of_reference=False),
        *channel_functions(second, node_of_reference=False),
    ]
    found = read(*functions)
    equal(found[0], first)
    equal(found[1], second)


def test_channels_may_come_channel_by_channel(read):
    records = some()
    functions = channel_functions(records)
    (found,) = read(*(functions[k] for channel in range(3) for k in range(channel, 9, 3)))
    equal(found, records)


def test_the_force_may_come_last(read):
    first, second = some(1), some(9, outputs=("1:+x", "7:+x"))
    functions = channel_functions(first) + channel_functions(second)
    turned = [functions[3 * k + j] for k in range(6) for j in (1, 2, 0)]
    found = read(*turned)
    equal(found[0], first)
    equal(found[1], second)


def test_a_second_set_of_channels_of_one_place_is_a_set_up(read):
    first, second = some(1), some(9, outputs=("1:+x", "7:+x"))
    found = read(*channel_functions(first), *channel_functions(second))
    equal(found[0], first)
    equal(found[1], second)


def test_a_hit_from_the_other_side_is_turned_to_the_first(read):
    first, other = some(1, hits=2), some(9, hits=1, reference="11:-z", outputs=("7:-x", "2:-y"))
    (found,) = read(*channel_functions(first), *channel_functions(other))
    assert found.reference == Dof.parse("11:+z")
    assert found.outputs == first.outputs
    np.testing.assert_allclose(found.force[2], -other.force[0], rtol=1e-11)
    np.testing.assert_allclose(found.motion[2, 0], -other.motion[0, 0], rtol=1e-11)
    np.testing.assert_allclose(found.motion[2, 1], other.motion[0, 1], rtol=1e-11)


def test_millimetres_and_kilonewtons_become_si(read):
    records = some(outputs=("7:+x", "2:-ry"))
    (found,) = read(units(1e3, 1e-3), *channel_functions(records))
    np.testing.assert_allclose(found.force, records.force / 1e-3, rtol=1e-11)
    np.testing.assert_allclose(found.motion[:, 0], records.motion[:, 0] / 1e3, rtol=1e-11)
    np.testing.assert_allclose(found.motion[:, 1], records.motion[:, 1], rtol=1e-11)


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_the_ordinate_tells_the_quantity(read, quantity):
    (found,) = read(*channel_functions(replace(some(), quantity=quantity)))
    assert found.quantity == quantity


def test_an_unstated_ordinate_takes_the_quantity_of_the_campaign(read):
    functions = [
        f if f.ordinate == 13 else replace(f, ordinate=0) for f in channel_functions(some())
    ]
    (found,) = read(*functions, quantity="mobility")
    assert found.quantity == "mobility"


def test_other_datasets_and_functions_are_passed_over(read):
    other = dataset("  9999", ["a dataset", "of nobody"])
    auto = Function(numbers(3, 5, real=True), func=2)
    (found,) = read(other, *channel_functions(some()), auto)
    equal(found, some())


def functions_with(index, **changes):
    functions = channel_functions(some())
    functions[index] = replace(functions[index], **changes)
    return functions


def test_a_file_without_a_force_is_refused(refusal):
    motions = [f for f in channel_functions(some()) if f.ordinate != 13]
    assert "no time record of the force (ordinate type 13)" in refusal(*motions)


def test_a_file_without_motions_is_refused(refusal):
    assert "no time record of motions" in refusal(channel_functions(some())[0])


def test_a_reaction_force_is_refused_with_a_hint(refusal):
    message = refusal(*functions_with(0, ordinate=9))
    assert "record 1 is a reaction force (9)" in message
    assert "the hammer needs an excitation force (13)" in message


def test_an_ordinate_that_is_no_motion_is_refused(refusal):
    assert "record 2 is of ordinate type 2" in refusal(*functions_with(1, ordinate=2))


def test_two_quantities_are_refused(refusal):
    changed = [replace(f, ordinate=11) for f in channel_functions(some(9, outputs=("1:+x",)))[1:2]]
    functions = channel_functions(some(hits=1))
    assert "mixes records for" in refusal(*functions, *changed)


def test_a_stated_quantity_overrides_the_file_with_a_remark(read):
    (stated,) = read(*channel_functions(some()), quantity="mobility")
    assert stated.quantity == "mobility"
    (remark,) = stated.remarks
    assert 'quantity = "mobility" of campaign.toml overrides accelerance' in remark


def test_a_stated_unit_overrides_the_file_with_a_remark(read):
    functions = channel_functions(some())
    (plain,), (stated,) = read(*functions), read(*functions, unit="g/lbf")
    ratio = stated.motion / np.where(plain.motion == 0, 1.0, plain.motion)
    np.testing.assert_allclose(ratio[plain.motion != 0], 9.80665)
    np.testing.assert_allclose(stated.force, 4.4482216152605 * plain.force)
    assert any('unit = "g/lbf" of campaign.toml overrides' in text for text in stated.remarks)


def test_labels_of_records_count(read):
    functions = channel_functions(some())
    (plain,) = read(*functions)
    labelled = [replace(f, motion_unit="lbf" if f.ordinate == 13 else "g") for f in functions]
    (found,) = read(*labelled)
    np.testing.assert_allclose(found.motion, 9.80665 * plain.motion)
    np.testing.assert_allclose(found.force, 4.4482216152605 * plain.force)
    assert len(found.remarks) == 2


def test_unequal_lengths_of_one_hit_are_refused_by_name(refusal):
    short = functions_with(4)
    short[4] = replace(short[4], data=short[4].data[:40], x=short[4].x[:40])
    message = refusal(*short)
    assert "records 4 and 5 belong together" in message
    assert "48 samples at 2048 Hz and 40" in message


def test_unequal_rates_of_one_hit_are_refused_by_name(refusal):
    slow = functions_with(4, x=np.arange(48) / 1024)
    assert "48 samples at 2048 Hz and 48 at 1024 Hz: export them with one" in refusal(*slow)


def test_unequal_starts_of_one_hit_are_refused_by_name(refusal):
    late = functions_with(4, x=(np.arange(48) + 7) / 2048)
    assert "records 4 and 5 belong together but start at 0 s and 0.00341797 s" in refusal(*late)


def test_a_motion_without_its_force_is_refused(refusal):
    functions = channel_functions(some())
    del functions[6]
    message = refusal(*functions)
    assert "record 7 is motion 3 of 7:+tx in load case 0" in message
    assert "the force has no such record at 11:+tz" in message


def test_a_force_without_motion_is_refused(refusal):
    functions = channel_functions(some())
    message = refusal(*functions, functions[0])
    assert "record 10 is a force without any motion: delete it" in message


def test_a_reference_that_contradicts_its_force_is_refused(refusal):
    message = refusal(*functions_with(1, ref=(11, -3)))
    assert "the reference of record 2 is 11:-tz, but its force in record 1 acts at" in message


def test_an_uneven_clock_is_refused(refusal):
    x = np.arange(48) / 2048
    x = x.copy()
    x[30:] += 0.5 / 2048
    assert "record 2 is not sampled evenly" in refusal(*functions_with(1, x=x, even=False))


@pytest.mark.parametrize("direction", [7, -9])
def test_a_direction_that_is_none_is_refused(refusal, direction):
    assert f"response direction {direction}" in refusal(*functions_with(1, rsp=(7, direction)))


def test_nan_is_refused_with_its_record(refusal):
    data = some().motion[0, 1].copy()
    data[3] = np.nan
    assert "record 3 (node 2) holds NaN" in refusal(*functions_with(2, data=data))


def test_a_complex_record_is_refused(refusal):
    assert "record 2 is a complex time record" in refusal(*functions_with(1, data=numbers(4, 48)))


def test_a_truncated_file_is_refused(file):
    path = file(*channel_functions(some()))
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(InputError, match=r"record 9 has no end mark|truncated"):
        holds_uff_time_records(path)


def shaken(records, further, *, node_of_reference=False):
    """Datasets of two forces and the motions that both made, repetition after repetition."""
    functions = channel_functions(records, order="<", node_of_reference=node_of_reference)
    size = 1 + len(records.outputs)
    for number, force in enumerate(further):
        head = functions[number * (size + 1)]
        functions.insert(number * (size + 1) + 1, replace(head, data=force, rsp=(3, 2), ref=(3, 2)))
    return functions


@pytest.mark.parametrize("hits", [1, 3])
def test_forces_at_once_are_records_of_each_with_the_others_beside_it(read, hits):
    expected = some(4, hits=hits)
    further = numbers(9, (hits, 48), real=True)
    first, second = read(*shaken(expected, further))
    equal(first, expected)
    assert (first.further_references, second.reference) == ((Dof("3", "+ty"),), Dof("3", "+ty"))
    np.testing.assert_allclose(first.further_forces[0], further, rtol=1e-11)
    np.testing.assert_allclose(second.force, further, rtol=1e-11)
    np.testing.assert_allclose(second.further_forces[0], expected.force, rtol=1e-11)
    np.testing.assert_allclose(second.motion, expected.motion, rtol=1e-11)


def test_forces_one_after_the_other_are_not_at_once(read):
    first, second = some(4), some(5, reference="3:+y")
    functions = [
        function
        for records in (first, second)
        for function in channel_functions(records, order="<", node_of_reference=False)
    ]
    for records in read(*functions):
        assert records.further_references == ()
