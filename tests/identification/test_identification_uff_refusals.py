"""What a universal file is refused for: always an InputError with file, record and remedy."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identification_examples import EVEN, MARK, UNEVEN, Function, dataset, numbers, units

from identification.readers.uff_frfs import read_uff
from identification.words import InputError

ONE = Function(numbers(1))
TWO = Function(numbers(2), rsp=(2, 3))


def joined(*blocks):
    return b"".join(b if isinstance(b, bytes) else b.content() for b in blocks)


@pytest.fixture
def refusal(tmp_path):
    """The message with which a file of these datasets is refused; it names the file."""

    def message(*blocks, **options):
        path = tmp_path / "impact.uff"
        path.write_bytes(joined(*blocks))
        with pytest.raises(InputError) as caught:
            read_uff(path, **options)
        assert str(path) in str(caught.value)
        return str(caught.value).replace(str(path), "FILE")

    return message


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.uff does not exist: name"):
        read_uff(tmp_path / "gone.uff")


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_uff(tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"freq,h\n1,2\n", b"\x00\xff" * 300, b"-1\n-1\n"]
)
def test_a_file_without_datasets_is_refused(refusal, content):
    assert "no dataset" in refusal(content)


def test_a_file_that_begins_in_the_middle_is_refused(refusal):
    assert "record" in refusal(ONE.content()[400:], TWO)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize(
    ("single", "stated", "words"),
    [
        (True, 6, "states double precision (data type 6), but its values are 13 characters wide"),
        (False, 5, "states single precision (data type 5), but its values are 20 characters wide"),
    ],
)
def test_values_of_the_other_precision_than_stated_are_named(refusal, even, single, stated, words):
    content = replace(ONE, single=single, even=even, x=EVEN if even else UNEVEN).content()
    count = f"{len(ONE.data):10d}"
    header = f"{5 if single else 6:10d}{count}".encode()
    assert header in content
    message = refusal(content.replace(header, f"{stated:10d}{count}".encode()))
    assert f"record 1 {words}" in message


def test_text_behind_the_last_dataset_is_refused(refusal):
    assert "after record 2" in refusal(ONE, TWO, b"appendix\n")


@pytest.mark.parametrize(
    "blocks",
    [
        [dataset("   151", ["model"] * 7)],
        [replace(ONE, func=6, data=np.linspace(0.1, 0.9, 9))],
        [replace(ONE, func=1), units(1.0, 1.0)],
        [dataset("  9999", ["x"])],
    ],
    ids=["header", "coherence", "time record", "unknown"],
)
def test_a_file_without_frf_is_refused(refusal, blocks):
    message = refusal(*blocks)
    assert "no FRF" in message
    assert "export" in message


@pytest.mark.parametrize("order", ["", "<"], ids=["ascii", "58b"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, complex(1, np.nan)])
def test_a_value_that_is_no_number_is_refused_with_its_record(refusal, order, value):
    data = TWO.data.copy()
    data[4] = value
    message = refusal(units(1.0, 1.0), ONE, replace(TWO, data=data, order=order))
    assert "FILE, record 3" in message
    assert "NaN" in message
    assert "export" in message


def test_a_coherence_that_is_no_number_is_refused(refusal):
    data = np.linspace(0.1, 0.9, 9)
    data[-1] = np.nan
    assert "record 2 " in refusal(ONE, replace(ONE, data=data, func=6))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("line", [0, 4, 8])
@pytest.mark.parametrize("first", [True, False], ids=["first record", "second record"])
def test_a_frequency_that_is_no_number_is_refused(refusal, value, line, first):
    x = UNEVEN.copy()
    x[line] = value
    good, bad = replace(ONE, x=UNEVEN, even=False), replace(TWO, x=x, even=False, order="<")
    assert "record" in refusal(*((bad, good) if first else (good, bad)))


def test_two_infinite_frequencies_are_refused(refusal):
    x = UNEVEN.copy()
    x[-2:] = np.inf
    assert "record" in refusal(replace(ONE, x=x, even=False, order="<"))


@pytest.mark.parametrize("x", [EVEN[::-1], np.repeat(EVEN[:5], 2)[:9]], ids=["falling", "repeated"])
def test_frequencies_that_do_not_rise_are_refused(refusal, x):
    assert "do not increase" in refusal(replace(ONE, x=x, even=False))


@pytest.mark.parametrize(
    "other",
    [
        replace(TWO, x=EVEN + 0.01),
        replace(TWO, x=EVEN[:8], data=TWO.data[:8]),
        replace(TWO, x=UNEVEN, even=False),
        replace(TWO, x=EVEN + 0.25, func=6, data=np.linspace(0.1, 0.9, 9)),
    ],
    ids=["shifted", "shorter", "uneven", "coherence"],
)
def test_unequal_axes_are_refused_with_both_records(refusal, other):
    message = refusal(units(1.0, 1.0), ONE, other)
    assert "records 2 and 3" in message
    assert "export" in message


@pytest.mark.parametrize("direction", [0, 7, -7, 12])
@pytest.mark.parametrize("end", ["rsp", "ref"])
def test_a_direction_that_is_none_is_refused(refusal, direction, end):
    message = refusal(TWO, replace(ONE, **{end: (7, direction)}))
    assert "FILE, record 2" in message
    assert f"direction {direction}" in message
    assert ("response" if end == "rsp" else "reference") in message


@pytest.mark.parametrize("ordinate", [0, 1, 2, 9, 13, 15, 99])
def test_an_ordinate_that_is_no_motion_is_refused(refusal, ordinate):
    message = refusal(TWO, replace(ONE, ordinate=ordinate))
    assert f"record 2: ordinate type {ordinate}" in message
    assert "campaign.toml" in message


@pytest.mark.parametrize("ordinate", [2, 9, 13])
def test_a_stated_quantity_does_not_make_a_force_a_motion(refusal, ordinate):
    assert "ordinate type" in refusal(replace(ONE, ordinate=ordinate), quantity="mobility")


def test_mixed_quantities_are_refused(refusal):
    message = refusal(ONE, replace(TWO, ordinate=8))
    assert "accelerance and receptance" in message
    assert "one file for each" in message


@pytest.mark.parametrize(("length", "force"), [(0, 1), (1, 0), (-1e3, 1), (1, np.nan), (np.inf, 1)])
def test_units_that_are_no_factors_are_refused(refusal, length, force):
    assert "record 1" in refusal(units(length, force), ONE)


@pytest.mark.parametrize("tail", [b"", b"garbled\n", b"1.0D+00\n"])
def test_a_dataset_that_cannot_be_read_is_named(refusal, tail):
    assert "FILE, record 2 " in refusal(ONE, dataset("   164", [tail.decode()]), TWO)


@pytest.mark.parametrize("order", ["", "<"], ids=["ascii", "58b"])
@pytest.mark.parametrize("kind", [0, 1, 3, 7])
def test_a_data_form_that_does_not_exist_is_refused(refusal, order, kind):
    content = replace(TWO, order=order).content().replace(b"         6", b"         %d" % kind, 1)
    assert "record 2" in refusal(ONE, content)


@pytest.mark.parametrize("count", [1, 2])
def test_a_line_that_only_ends_like_a_mark_does_not_hide_records(tmp_path, count):
    # A mark is a line of its own; integer fields of -1 end lines of 2412, 2414 and others.
    foreign = dataset("  9999", [f"{4:10d}{-1:10d}"] * count)
    path = tmp_path / "a.uff"
    path.write_bytes(joined(foreign, ONE, TWO, foreign, replace(ONE, rsp=(7, 2))))
    try:
        table = read_uff(path)
    except InputError:
        return
    assert [str(d) for d in table.responses] == ["7:+tx", "2:+tz", "7:+ty"]


def test_letters_among_the_numbers_are_refused(refusal):
    content = TWO.content().replace(b"E+", b"x+", 1)
    assert "record 2" in refusal(ONE, content)


def test_a_58b_with_less_than_it_announces_is_truncated(refusal):
    whole = TWO.content() if TWO.order == "<" else replace(TWO, order="<").content()
    message = refusal(ONE, whole[:-60])
    assert "FILE, record 2 is truncated" in message
    assert "144 bytes" in message
    assert "again" in message


@pytest.mark.parametrize("announced", [-8, 0, 72, 136, 152, 5000])
def test_a_58b_that_is_cut_and_miscounts_is_refused(refusal, announced):
    content = replace(ONE, order="<", announced_bytes=announced).content()
    mark = content.rindex(b"    -1")
    assert "record 1" in refusal(content[: mark - 9] + content[mark:])


def test_a_58b_whose_header_names_no_number_of_bytes_is_refused(refusal):
    content = replace(ONE, order="<").content().replace(b"         144", b"        many")
    assert "record 1: the 58b header lacks the number" in refusal(content)


@pytest.mark.parametrize("number_format", [1, 3], ids=["VAX", "IBM"])
def test_a_58b_in_floating_point_of_another_kind_is_refused(refusal, number_format):
    # Field 2 of the header: 1 DEC VMS, 2 IEEE 754, 3 IBM 5/370. The bytes mean other numbers.
    assert "record 1" in refusal(replace(ONE, order=">", float_format=number_format))


@pytest.mark.parametrize("order", ["", "<"], ids=["ascii", "58b"])
@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
def test_fewer_values_than_the_record_announces_are_refused(refusal, order, even):
    # All records alike, as an exporter that lost the last block would write.
    blocks = [
        replace(f, data=f.data[:6], x=EVEN[:6], announced_values=9, order=order, even=even)
        for f in (ONE, TWO)
    ]
    assert "record 1" in refusal(*blocks)


def test_blanks_behind_binary_data_are_no_values(tmp_path):
    path = tmp_path / "a.uff"
    path.write_bytes(replace(ONE, order="<", tail=b" " * 16 + b"\n").content())
    try:
        table = read_uff(path)
    except InputError:
        return
    np.testing.assert_array_equal(table.values[:, 0, 0], ONE.data)


def data_with_a_mark(line):
    """Values whose bytes hold an end mark: 5e-5 beside any other number."""
    value = struct.unpack("<d", b"    -1\n\x3f")[0]
    data = ONE.data.copy()
    data[line] = complex(value, 2.0)
    return data


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("others", [[], [replace(TWO, order="<")]], ids=["alone", "with another"])
def test_binary_data_that_hold_an_end_mark_are_read_whole_or_refused(tmp_path, count, others):
    data = data_with_a_mark(3)
    if count == 2:
        data[6] = data[3]
    path = tmp_path / "a.uff"
    path.write_bytes(joined(replace(ONE, data=data, order="<"), *others))
    try:
        table = read_uff(path)
    except InputError:
        return
    assert table.values.shape == (9, 1 + len(others), 1)
    np.testing.assert_array_equal(table.values[:, 0, 0], data)


FILES = {
    "ascii double": [ONE],
    "ascii single uneven": [replace(ONE, single=True, even=False, x=UNEVEN)],
    "ascii real CRLF": [replace(ONE, data=numbers(3, real=True), newline=b"\r\n")],
    "58b": [replace(ONE, order="<")],
    "58b big single": [replace(ONE, order=">", single=True)],
    "58b CRLF uneven": [
        replace(ONE, order="<", even=False, x=UNEVEN, newline=b"\r\n", tail=b"\r\n")
    ],
    "58b without a line end": [replace(ONE, order="<", tail=b"")],
    "four records": [
        units(1e3, 1.0),
        replace(ONE, order="<"),
        replace(TWO, order=">", single=True),
        replace(ONE, rsp=(7, 3), data=numbers(9)),
    ],
}


def same_table(one, other):
    return (
        np.array_equal(one.values, other.values)
        and np.array_equal(one.freq_hz, other.freq_hz)
        and one.responses == other.responses
        and one.references == other.references
    )


@pytest.mark.parametrize("name", FILES)
def test_a_file_cut_anywhere_is_refused_or_was_whole(tmp_path, name):
    # Every cut. Between two datasets a universal file has nothing that tells of more; there the
    # table may be smaller, but what is in it is exact.
    content = joined(*FILES[name])
    path = tmp_path / "cut.uff"
    path.write_bytes(content)
    whole = read_uff(path)
    ends = {len(joined(*FILES[name][: k + 1])): k + 1 for k in range(len(FILES[name]) - 1)}
    # Also without its line end, or with the blanks that begin the next mark.
    cleanly = {end + more: number for end, number in ends.items() for more in range(-1, 5)}
    for cut in range(len(content)):
        path.write_bytes(content[:cut])
        try:
            table = read_uff(path)
        except InputError:
            continue
        if cut in cleanly:
            kept = len(table.responses)
            assert kept == cleanly[cut] - 1  # the first dataset holds the units
            assert table.responses == whole.responses[:kept]
            np.testing.assert_array_equal(table.values, whole.values[:, :kept])
            continue
        assert not content[cut:].strip(), f"cut at byte {cut} of {len(content)}"
        assert same_table(table, whole)


@given(
    sizes=st.lists(st.integers(4, 60), min_size=1, max_size=5),
    part=st.floats(0, 1, exclude_max=True),
    data=st.data(),
)
def test_a_58b_of_any_size_cut_in_its_last_record_is_refused(tmp_path_factory, sizes, part, data):
    # Records of different length: the rest of a header cut short must not be sought at the
    # beginning of the file.
    single = data.draw(st.booleans())
    blocks = [
        Function(
            np.zeros(size),
            0.25 * np.arange(size),
            rsp=(k + 1, 1),
            func=4 if size == sizes[-1] else 1,
            order="<",
            single=single,
        ).content()
        for k, size in enumerate(sizes)
    ]
    first, beyond = len(MARK), len(blocks[-1]) - len(MARK)  # from the start mark to the data's end
    path = tmp_path_factory.mktemp("cut") / "a.uff"
    path.write_bytes(b"".join(blocks[:-1]) + blocks[-1][: first + int(part * (beyond - first))])
    with pytest.raises(InputError):
        read_uff(path)


@given(place=st.floats(0, 1, exclude_max=True), lost=st.integers(1, 200), data=st.data())
def test_bytes_lost_from_the_middle_never_end_in_another_exception(
    tmp_path_factory, place, lost, data
):
    content = joined(*FILES[data.draw(st.sampled_from(sorted(FILES)))])
    start = int(place * len(content))
    path = tmp_path_factory.mktemp("lost") / "a.uff"
    path.write_bytes(content[:start] + content[start + lost :])
    try:
        table = read_uff(path)
    except InputError:
        return
    assert np.isfinite(table.values).all()
