"""What programs write into universal files beside the format, and what no reader needs."""

import struct
import time
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import pyuff
from identification_examples import (
    EVEN,
    FIRST,
    MARK,
    SECOND,
    TEST,
    THIRD,
    UNEVEN,
    Function,
    dataset,
    numbers,
    read_small,
    uff,
    units,
)

from identification.readers.layout import read_layout
from identification.readers.uff_frfs import read_uff
from identification.readers.uff_modes import read_uff_modes
from identification.readers.uff_records import read_uff_records
from identification.words import InputError

GROUPS_2467 = dataset("  2467", [f"{1:10d}" + f"{0:10d}" * 6 + f"{1:10d}", "Left", f"{8:10d}" * 4])
BROKEN_2414 = dataset("  2414", [f"{1:10d}", "LOADCASE", f"{9:10d}", " garbage"])


@pytest.fixture
def read(tmp_path):
    """Reads the FRFs of a file of these datasets."""

    def read_written(*blocks, **options):
        path = tmp_path / "impact.uff"
        path.write_bytes(uff(*blocks))
        return read_uff(path, **options)

    return read_written


@pytest.fixture
def campaign(tmp_path):
    return partial(read_small, tmp_path)


def labels(dofs):
    return [str(dof) for dof in dofs]


@pytest.mark.parametrize("complex_data", [True, False])
def test_an_uneven_58b_of_pyuff_is_read_though_it_counts_the_values_alone(tmp_path, complex_data):
    path, data = tmp_path / "a.uff", numbers(6, real=not complex_data)
    record = pyuff.prepare_58(
        **{"binary": 1, "func_type": 4, "rsp_node": 7, "rsp_dir": 1, "ref_node": 11, "ref_dir": 3},
        **{"data": data, "x": UNEVEN, "abscissa_spacing": 0, "abscissa_spec_data_type": 18},
        **{"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13},
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        for _ in range(2):
            pyuff.UFF(str(path)).write_sets(record | {"n_bytes": 0}, "add")
    assert f"{8 * len(data):12d}".encode() in path.read_bytes()  # the miscount
    table = read_uff(path)
    np.testing.assert_array_equal(table.freq_hz, UNEVEN)
    np.testing.assert_array_equal(table.values[:, 0, 0], data)


@pytest.mark.parametrize("complex_data", [True, False])
def test_an_abscissa_of_single_precision_beside_doubles_is_read(read, complex_data):
    data = numbers(6, real=not complex_data)
    parts = (data.real, data.imag) if complex_data else (data,)
    layout = ">f" + "d" * len(parts)
    payload = b"".join(struct.pack(layout, *point) for point in zip(UNEVEN, *parts, strict=True))
    whole = replace(FIRST, data=data, x=UNEVEN, even=False, order=">").content()
    begin, end = whole.index(b"NONE", whole.index(b"Force") + 50), whole.rindex(MARK)
    begin = whole.index(b"\n", begin) + 1
    table = read(whole[:begin] + payload + b"\n" + whole[end:])
    np.testing.assert_array_equal(table.freq_hz, UNEVEN)
    np.testing.assert_array_equal(table.values[:, 0, 0], data)


@pytest.mark.parametrize("single", [True, False])
def test_values_of_single_form_in_double_precision_are_read(read, single):
    form = f"{5 if single else 6:10d}{9:10d}".encode()
    content = replace(FIRST, order="<").content().replace(f"{6:10d}{9:10d}".encode(), form, 1)
    np.testing.assert_array_equal(read(content).values[:, 0, 0], FIRST.data)


@pytest.mark.parametrize("letter", [b"D", b"d", b"e"])
def test_exponents_of_fortran_are_read(read, letter):
    for function in (FIRST, replace(FIRST, x=UNEVEN, even=False), replace(FIRST, single=True)):
        content = function.content()
        table = read(content.replace(b"E+", letter + b"+").replace(b"E-", letter + b"-"))
        np.testing.assert_array_equal(table.values, read(content).values)
        np.testing.assert_array_equal(table.freq_hz, read(content).freq_hz)


def test_an_exponent_of_three_digits_without_its_letter_is_read(read):
    data = FIRST.data.copy()
    data[4] = 1.25e-103 + 2j
    content = replace(FIRST, data=data).content()
    assert content.count(b"E-103") == 1
    table = read(content.replace(b" 1.250000000000E-103", b"  1.250000000000-103"))
    assert table.values[4, 0, 0] == data[4]


def test_a_byte_order_mark_is_passed_over(read):
    np.testing.assert_array_equal(read(b"\xef\xbb\xbf", FIRST).values, read(FIRST).values)


def test_a_universal_file_may_be_called_ufb(campaign):
    text = TEST.replace("a.uff", "b.ufb")
    assert len(campaign(text, b_ufb=uff(FIRST, SECOND, THIRD)).tests) == 2


@pytest.mark.parametrize(
    ("broken", "kind"),
    [
        (BROKEN_2414, 2414),
        (dataset("  2411", [f"{1:10d}" * 4, "1.0 2.0"]), 2411),
        (dataset("    15", ["one two three"]), 15),
        (dataset("    55", ["NONE"] * 3), 55),
        (dataset("  2420", ["1", "part", "x"]), 2420),
        (replace(FIRST, func=2).content().replace(b"E+", b"x+"), 58),
    ],
)
def test_a_malformed_dataset_that_nobody_needs_costs_a_remark(read, broken, kind):
    table = read(FIRST, broken, SECOND)
    np.testing.assert_array_equal(table.values[:, :, 0], read(FIRST, SECOND).values[:, :, 0])
    (remark,) = table.remarks
    assert f"impact.uff: record 2 (dataset {kind}) is malformed and left out" in remark


def test_kinds_that_no_reader_uses_are_named_and_print_nothing(read, capfd):
    elsewhere = dataset("  2414", [f"{1:10d}", "NONE", f"{5:10d}", *["NONE"] * 5, f"{1:10d}" * 6])
    table = read(GROUPS_2467, elsewhere, FIRST, *[dataset("    82", ["1"])] * 7)
    assert capfd.readouterr() == ("", "")
    groups, lines = (remark for remark in table.remarks if "no reader" in remark)
    assert "record 1 (dataset 2467) is left out" in groups
    assert "records 4, 5, 6, 7, 8 and 2 more (dataset 82) are left out" in lines


def test_the_usual_datasets_beside_frfs_need_no_remark(read):
    node = dataset("  2411", [f"{7:10d}" + f"{0:10d}" * 3, "1.0D+00 2.0D+00 3.0D+00"])
    assert read(dataset("   151", ["model"] * 7), units(1.0, 1.0), node, FIRST).remarks == ()


def test_a_malformed_dataset_beside_time_records_costs_a_remark(tmp_path):
    path = tmp_path / "hits.uff"
    force = Function(numbers(1, 48, real=True), 0.01 * np.arange(48), func=1, ordinate=13)
    motion = replace(force, ordinate=12, ref=(7, 1))
    path.write_bytes(uff(BROKEN_2414, force, motion))
    (records,) = read_uff_records(path)
    assert "record 1 (dataset 2414) is malformed" in records.remarks[0]


@pytest.mark.parametrize(
    "lines",
    [
        [f"{1:10d}" * 4, "1.0 2.0"],
        [f"{1:10d}" * 4],
        [f"{1:10d}" * 4, "1.0 2.0 3.0 4.0 5.0 6.0"],
        [f"{1:10d}" * 4, "1.0 nan 3.0"],
        ["1.5 0 0 0", "1.0 2.0 3.0"],
        ["1e30 0 0 0", "1.0 2.0 3.0"],
    ],
)
def test_broken_nodes_are_refused_where_they_are_needed(tmp_path, lines):
    path = tmp_path / "a.unv"
    path.write_bytes(units(1.0, 1.0) + dataset("  2411", lines))
    for read_nodes in (read_layout, read_uff_modes):
        with pytest.raises(InputError, match=r"a\.unv, record 2 cannot be read: export"):
            read_nodes(path)


def mode(values, *, frequency=12.5, damping=0.01, kind=55):
    numbers_line = f"{frequency:13.5E}{1:13.5E}{damping:13.5E}{0:13.5E}"
    kinds = "".join(f"{k:10d}" for k in (1, 2, 2, 8, 2, 3))
    return dataset(f"{kind:6d}", [*["NONE"] * 5, kinds, f"{1:10d}" * 4, numbers_line, *values])


@pytest.mark.parametrize(
    ("values", "options"),
    [
        (["         1", "1.0 2.0"], {}),
        (["         1", "1.0 2.0 nan"], {}),
        (["         1", "1.0 2.0 3.0", "         2"], {}),
        (["1.0 2.0 3.0", "         1", "         2", "1.0 2.0 3.0"], {}),
        (["         1", "1.0 2.0 3.0"], {"damping": 1e300}),
        (["         1", "1.0 2.0 3.0"], {"frequency": np.inf}),
    ],
)
def test_broken_modes_are_refused(tmp_path, values, options):
    path = tmp_path / "a.unv"
    path.write_bytes(mode(["         1", "1.0 2.0 3.0"]) + mode(values, **options))
    with pytest.raises(InputError, match=r"a\.unv, record 2 cannot be read: export"):
        read_uff_modes(path)


def test_many_end_marks_take_little_time(read):
    begin = time.process_time()
    with pytest.raises(InputError, match="no FRF"):
        read((MARK + b"\n") * 400_000)
    assert time.process_time() - begin < 4


@pytest.mark.parametrize("count", [-472, -1])
def test_a_negative_number_of_bytes_is_refused(read, count):
    with pytest.raises(InputError, match=f"record 2: its header announces {count} bytes"):
        read(FIRST, replace(SECOND, order="<", announced_bytes=count))


def test_a_negative_number_of_values_is_refused(read):
    with pytest.raises(InputError, match=r"record 1: its header announces .* -9 values"):
        read(replace(FIRST, order="<", announced_values=-9))


SCALARS = [replace(FIRST, rsp=(7, 0)), replace(SECOND, rsp=(2, 0))]


@pytest.mark.parametrize("channels", ['["2:-y", "7:+z"]', '["7:z", "2:-y", "11:x"]'])
def test_the_direction_of_a_scalar_can_be_stated(campaign, channels):
    (test,) = campaign(f"{TEST}channels = {channels}\n", a_uff=uff(*SCALARS)).tests
    assert labels(test.estimate.frf.outputs) == ["acc7:+tz", "acc2:-ty"]
    np.testing.assert_allclose(test.estimate.frf.values[:, 0, 0], FIRST.data, rtol=1e-12)


def test_a_range_of_nodes_states_the_direction_of_scalars(campaign):
    text = TEST + 'channels = "nodes 2 7, z"\nreferences = ["11:-x"]\n'
    scalars = [replace(f, ref=(11, 0)) for f in SCALARS]
    (test,) = campaign(text, a_uff=uff(*scalars)).tests
    assert labels(test.estimate.frf.outputs) == ["acc7:+tz", "acc2:+tz"]
    assert str(test.condition.reference) == "hit11:-tx"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", r'no direction there: .* channels = \["7:\+z"\] or "nodes 7, z"'),
        ('channels = ["2:+z"]\n', "states no direction there"),
        ('channels = ["7:+z", "7:+x"]\n', "states 2 directions there"),
        ('channels = ["7:+z", "2:+z"]\nreferences = ["11:+z"]\n', "remove references"),
    ],
)
def test_a_scalar_without_one_stated_direction_is_refused(campaign, line, message):
    with pytest.raises(InputError, match=message):
        campaign(TEST + line, a_uff=uff(*SCALARS))


def test_directions_of_scalar_time_records_can_be_stated(tmp_path):
    path = tmp_path / "hits.uff"
    force = Function(
        numbers(1, 48, real=True), 0.01 * np.arange(48), (11, 0), (0, 0), func=1, ordinate=13
    )
    path.write_bytes(uff(force, replace(force, rsp=(7, 0), ordinate=12)))
    (records,) = read_uff_records(path, channels=["7:-y"], references=["11:+z"])
    assert labels([records.reference, *records.outputs]) == ["11:+tz", "7:-ty"]
    with pytest.raises(InputError, match=r'references = \["11:\+z"\]'):
        read_uff_records(path, channels=["7:-y"])


@pytest.mark.parametrize("lowest", [1e-5, 1e-12])
def test_a_first_line_that_stands_for_zero_is_at_zero(campaign, lowest):
    x = np.r_[lowest, EVEN[:-1]]
    functions = [replace(f, x=x, even=False) for f in (FIRST, SECOND)]
    read = campaign(a_uff=uff(*functions))
    np.testing.assert_array_equal(read.freq_hz, np.r_[0.0, EVEN[:-1]])
    assert f"a.uff: its first line, {lowest:g} Hz, counts as 0 Hz" in read.remarks


def test_a_first_line_near_zero_stays(campaign):
    x = np.r_[0.01, EVEN[:-1]]
    functions = [replace(f, x=x, even=False) for f in (FIRST, SECOND)]
    np.testing.assert_array_equal(campaign(a_uff=uff(*functions)).freq_hz, x)
