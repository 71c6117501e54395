"""FRF tables of .mat and .npz files: layouts, units, the grammar of channels."""

import re
from pathlib import Path

import numpy as np
import pytest
from array_files import FREQ, OPTIONS, refusal, save_frfs, tables
from hypothesis import given
from hypothesis import strategies as st

from identification.readers.array_frfs import read_arrays
from identification.readers.channel_labels import parse_channels
from identification.words import InputError


@pytest.fixture(params=[".mat", ".npz"])
def path(request, tmp_path):
    return tmp_path / f"test{request.param}"


@pytest.mark.parametrize("freq_last", [True, False])
def test_either_order_of_axes_is_read(path, freq_last):
    values, coherence = tables()
    if freq_last:
        save_frfs(path, np.moveaxis(values, 0, 2), np.moveaxis(coherence, 0, 2))
    else:
        save_frfs(path, values, coherence)
    table = read_arrays(path, **OPTIONS)
    np.testing.assert_array_equal(table.values, values)
    np.testing.assert_array_equal(table.coherence, coherence)
    np.testing.assert_array_equal(table.freq_hz, FREQ)
    assert [str(d) for d in table.responses] == ["7:+tx", "7:-ty", "2:+tz", "acc1:+rx", "2:+tx"]
    assert [str(d) for d in table.references] == ["11:+tz", "3:-tx"]
    assert table.measured.all()


def test_frfs_and_coherences_may_have_different_orders_of_axes(path):
    values, coherence = tables()
    save_frfs(path, values, np.moveaxis(coherence, 0, 2))
    np.testing.assert_array_equal(read_arrays(path, **OPTIONS).coherence, coherence)


def test_the_layout_of_the_seed_is_read(tmp_path):
    # FRFs 69 x 3 x 801, COHs alike, freqs 1 x 801 (FACTS); single precision keeps the file small.
    values, coherence = tables(801, 69, 3)
    path = save_frfs(
        tmp_path / "frf.mat",
        np.moveaxis(values, 0, 2).astype(np.complex64),
        np.moveaxis(coherence, 0, 2).astype(np.float32),
        np.linspace(0, 200, 801)[None, :],
    )
    references = ["11:+x", "11:+y", "11:+z"]
    table = read_arrays(
        path, channels="nodes 1..23, xyz", references=references, quantity="accelerance", unit=None
    )
    assert table.values.shape == (801, 69, 3)
    assert str(table.responses[4]) == "2:+ty"
    np.testing.assert_allclose(table.values[400, 4, 2], values[400, 4, 2], rtol=1e-6)


def test_freq_first_wins_where_both_orders_fit(path):
    values = tables(3, 3, 3)[0]
    save_frfs(path, values, freq=FREQ[:3])
    names = ["1:x", "2:x", "3:x"]
    table = read_arrays(path, **{**OPTIONS, "channels": names, "references": names})
    np.testing.assert_array_equal(table.values, values)


@pytest.mark.parametrize("freq_last", [True, False])
def test_one_reference_may_come_as_a_matrix(path, freq_last):
    values, coherence = tables(inputs=1)
    matrix, matrix_of_coherence = values[:, :, 0], coherence[:, :, 0]
    if freq_last:
        matrix, matrix_of_coherence = matrix.T, matrix_of_coherence.T
    save_frfs(path, matrix, matrix_of_coherence)
    table = read_arrays(path, **{**OPTIONS, "references": ["11:+z"]})
    np.testing.assert_array_equal(table.values, values)
    np.testing.assert_array_equal(table.coherence, coherence)


@pytest.mark.parametrize("shape", [(7,), (7, 1), (1, 7)])
def test_frequencies_may_be_a_row_or_a_column(path, shape):
    values, _ = tables()
    save_frfs(path, values, freq=FREQ.reshape(shape))
    np.testing.assert_array_equal(read_arrays(path, **OPTIONS).freq_hz, FREQ)


def test_coherence_may_be_absent(path):
    save_frfs(path, tables()[0])
    assert read_arrays(path, **OPTIONS).coherence is None


def test_rounding_beyond_one_is_clipped_from_a_coherence(path):
    values, coherence = tables()
    coherence[2, 1, 1] = 1 + 1e-7
    save_frfs(path, values, coherence)
    assert read_arrays(path, **OPTIONS).coherence.max() == 1


def test_coherence_kept_as_complex_counts_by_its_real_part(path):
    # |Gxy|^2 computed as Gxy * conj(Gxy) stays complex in numpy.
    values, coherence = tables()
    save_frfs(path, values, coherence + 1e-17j)
    np.testing.assert_array_equal(read_arrays(path, **OPTIONS).coherence, coherence)


@pytest.mark.parametrize("ending", [".MAT", ".Mat"])
def test_the_case_of_the_ending_does_not_matter(tmp_path, ending):
    values, _ = tables()
    path = save_frfs(tmp_path / "a.mat", values).rename(tmp_path / f"a{ending}")
    np.testing.assert_array_equal(read_arrays(path, **OPTIONS).values, values)


@pytest.mark.parametrize(
    ("quantity", "unit", "si"),
    [
        ("accelerance", None, 1.0),
        ("accelerance", "m/s^2/N", 1.0),
        ("accelerance", "mm/s^2/N", 1e-3),
        ("accelerance", "um/s^2/N", 1e-6),
        ("accelerance", "g/N", 9.80665),
        ("mobility", "m/s/N", 1.0),
        ("mobility", "mm/s/N", 1e-3),
        ("receptance", "m/N", 1.0),
        ("receptance", "um/N", 1e-6),
        ("receptance", "nm/N", 1e-9),
    ],
)
def test_values_become_si(tmp_path, quantity, unit, si):
    values, _ = tables()
    path = save_frfs(tmp_path / "a.npz", values)
    table = read_arrays(path, **{**OPTIONS, "quantity": quantity, "unit": unit})
    assert table.quantity == quantity
    factors = np.array([1.0 if dof.is_rotation else si for dof in table.responses])
    np.testing.assert_allclose(table.values, values * factors[:, None], rtol=1e-15)


@pytest.mark.parametrize(
    ("quantity", "unit"),
    [
        ("accelerance", "m/s/N"),
        ("mobility", "g/N"),
        ("receptance", "mm/s^2/N"),
        ("accelerance", "furlong/N"),
        ("accelerance", ""),
    ],
)
def test_a_unit_of_another_quantity_is_refused(tmp_path, quantity, unit):
    path = save_frfs(tmp_path / "a.npz", tables()[0])
    message = refusal(path, quantity=quantity, unit=unit)
    assert repr(unit) in message
    assert "write a motion over a force" in message


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("nodes 1..2, xyz", ["1:+tx", "1:+ty", "1:+tz", "2:+tx", "2:+ty", "2:+tz"]),
        ("nodes 1..4 7, y", ["1:+ty", "2:+ty", "3:+ty", "4:+ty", "7:+ty"]),
        ("nodes 5,3, zx", ["5:+tz", "5:+tx", "3:+tz", "3:+tx"]),
        ("  nodes 12 xy ", ["12:+tx", "12:+ty"]),
        (
            ["nodes 1..2, xz", "gap_a.2", "7:-y"],
            ["1:+tx", "1:+tz", "2:+tx", "2:+tz", "gap_a.2", "7:-ty"],
        ),
        (["nodes 1 3, z", "nodes 5, z"], ["1:+tz", "3:+tz", "5:+tz"]),
        ("nodes 3..3, x", ["3:+tx"]),
        (["1:+x", "acc7:-ry", "2:z"], ["1:+tx", "acc7:-ry", "2:+tz"]),
    ],
)
def test_channels_are_listed_node_by_node(text, expected):
    assert [str(dof) for dof in parse_channels(Path("a.mat"), text)] == expected


@given(
    ranges=st.lists(st.tuples(st.integers(1, 500), st.integers(0, 4)), min_size=1, max_size=6),
    axes=st.permutations("xyz"),
    separator=st.sampled_from([" ", ", ", ",", "  "]),
)
def test_any_list_of_ranges_is_all_its_nodes_or_names_the_doubled_one(ranges, axes, separator):
    items = [f"{a}..{a + more}" if more else str(a) for a, more in ranges]
    nodes = [node for a, more in ranges for node in range(a, a + more + 1)]
    text = f"nodes {separator.join(items)}, {''.join(axes)}"
    if len(set(nodes)) < len(nodes):
        with pytest.raises(InputError, match="twice"):
            parse_channels(Path("a.mat"), text)
        return
    found = parse_channels(Path("a.mat"), text)
    assert [(int(d.point), d.direction) for d in found] == [
        (node, f"+t{axis}") for node in nodes for axis in axes
    ]


@pytest.mark.parametrize(
    "channels",
    [
        "",
        "nodes",
        "nodes 1..23",
        "node 1..23, xyz",
        "nodes 1..23, xyw",
        "nodes 1..2..3, x",
        "nodes 1...4, x",
        "nodes 1.4, x",
        "nodes ..4, x",
        "nodes 1.., x",
        "nodes 1..4, xx",
        "nodes 1..4 3, x",
        "nodes 4..1 7, x",
        "nodes 1..1000000000000, x",
        "nodes 1..1000000000, x",
        "nodes " + "9" * 5000 + ", x",
        "nodes" + " " * 100_000 + "1",
        "1:+x",
        ["1:+x", "1:-x"],
        ["1:+w"],
        ["1"],
        [":+x"],
        [""],
    ],
)
def test_channels_that_make_no_sense_are_refused(channels):
    with pytest.raises(InputError, match=re.escape("a.mat")):
        parse_channels(Path("a.mat"), channels)


def test_labels_that_are_named_twice_are_listed():
    with pytest.raises(InputError, match=re.escape("channels name 3:+tx, 4:+ty twice: correct")):
        parse_channels(Path("a.mat"), ["3:+x", "4:+y", "3:-x", "4:y", "5:z"])
    many = [f"{node}:+x" for node in range(7)] * 2
    with pytest.raises(InputError, match=re.escape("4:+tx, ... (7 in all) twice: correct")):
        parse_channels(Path("a.mat"), many)


@pytest.mark.parametrize("second", ["11:+x", "11:-x"])
def test_a_reference_named_twice_is_refused(tmp_path, second):
    path = save_frfs(tmp_path / "a.npz", tables()[0])
    assert "twice" in refusal(path, references=["11:+x", second])


def test_a_bad_reference_is_refused(tmp_path):
    path = save_frfs(tmp_path / "a.npz", tables()[0])
    assert "'11'" in refusal(path, references=["11", "3:x"])
