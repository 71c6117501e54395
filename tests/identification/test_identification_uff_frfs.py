"""Universal files in: every form of dataset 58, signs, units, quantities, what else is in them."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import pyuff
from identification_examples import EVEN, UNEVEN, Function, dataset, numbers, units

from identification.readers.uff_frfs import read_uff
from identification.words import InputError

ONE = Function(numbers(1))


@pytest.fixture
def read(tmp_path):
    """Writes datasets one after the other and reads them."""

    def read_blocks(*blocks, **options):
        path = tmp_path / "file.uff"
        path.write_bytes(b"".join(b if isinstance(b, bytes) else b.content() for b in blocks))
        return read_uff(path, **options)

    return read_blocks


def labels(dofs):
    return [str(dof) for dof in dofs]


def tolerance_of(function):
    """Half a unit of the last digit or bit that the form keeps, relative."""
    if function.order:
        return 2.0**-24 if function.single else 0
    return 5.01e-6 if function.single else 5.01e-13


@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
@pytest.mark.parametrize("real", [True, False], ids=["real", "complex"])
@pytest.mark.parametrize("single", [True, False], ids=["single", "double"])
@pytest.mark.parametrize("order", ["", "<", ">"], ids=["ascii", "little", "big"])
@pytest.mark.parametrize("newline", [b"\n", b"\r\n"], ids=["lf", "crlf"])
@pytest.mark.parametrize("lines", [4, 7, 9])
def test_every_form_of_a_record_gives_its_frequencies_and_values(
    read, even, real, single, order, newline, lines
):
    x = (EVEN if even else UNEVEN)[:lines]
    function = Function(
        numbers(2, lines, real=real),
        x,
        even=even,
        single=single,
        order=order,
        newline=newline,
        tail=newline,
    )
    table = read(function)
    np.testing.assert_array_equal(table.freq_hz, x)  # chosen exact in every form
    assert table.values.shape == (lines, 1, 1)
    worst = np.abs(table.values[:, 0, 0] / function.data - 1).max()
    assert worst <= tolerance_of(function) + 1e-15  # the division itself rounds


def test_a_58b_without_a_line_end_behind_its_data_is_read(read):
    function = replace(ONE, order="<", tail=b"")
    np.testing.assert_array_equal(read(function, function_at(2)).values[:, 0, 0], function.data)


def function_at(direction, **changed):
    return replace(Function(numbers(direction + 40), order="<"), rsp=(7, direction), **changed)


def test_binary_data_may_hold_line_ends(read):
    # 0x0a0a0a0a0a0a0a0a and 0x0d0a... as doubles, and then a whole 58b of them.
    bits = np.array([0x0A0A0A0A0A0A0A0A, 0x0D0A0D0A0D0A0D0A] * 4 + [0x0A0D202020200A0D], np.uint64)
    data = bits.view(float) + 1j * bits[::-1].view(float)
    np.testing.assert_array_equal(read(replace(ONE, data=data, order="<")).values[:, 0, 0], data)


@pytest.mark.parametrize("title", [b"Pr\xfcfstand", "Prüfstand".encode(), b" " * 80, b""])
def test_any_text_may_stand_in_the_title(read, title):
    np.testing.assert_allclose(
        read(replace(ONE, title=title)).values[:, 0, 0], ONE.data, rtol=1e-12
    )


def test_outputs_and_inputs_are_told_apart_and_kept_in_order(read):
    responses = [(7, 3), (2, 1), (7, 1)]
    references = [(11, 1), (3, 2)]
    functions = [
        Function(numbers(10 * i + j), rsp=rsp, ref=ref)
        for j, ref in enumerate(references)
        for i, rsp in enumerate(responses)
    ]
    table = read(*functions)
    assert labels(table.responses) == ["7:+tz", "2:+tx", "7:+tx"]
    assert labels(table.references) == ["11:+tx", "3:+ty"]
    assert table.measured.all()
    for k, function in enumerate(functions):
        np.testing.assert_allclose(table.values[:, k % 3, k // 3], function.data, rtol=1e-12)


@pytest.mark.parametrize(
    ("direction", "label"),
    [(1, "+tx"), (2, "+ty"), (3, "+tz"), (4, "+rx"), (5, "+ry"), (6, "+rz")],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_direction_is_read_with_its_sign(read, direction, label, sign):
    signed = ("+" if sign > 0 else "-") + label[1:]
    response = read(replace(ONE, rsp=(7, sign * direction)))
    reference = read(replace(ONE, ref=(11, sign * direction)))
    assert labels(response.responses) == [f"7:{signed}"]
    assert labels(reference.references) == [f"11:{signed}"]
    # The value belongs to the signed direction as it is.
    np.testing.assert_allclose(response.values[:, 0, 0], ONE.data, rtol=1e-12)
    np.testing.assert_allclose(reference.values[:, 0, 0], ONE.data, rtol=1e-12)


def test_a_reference_hit_both_ways_flips_the_second_record(read):
    first = Function(numbers(1), rsp=(7, 1), ref=(11, 3))
    second = Function(numbers(2), rsp=(7, 2), ref=(11, -3))
    table = read(first, second)
    assert labels(table.references) == ["11:+tz"]
    np.testing.assert_allclose(table.values[:, 1, 0], -second.data, rtol=1e-12)


def test_a_response_of_either_sign_flips_the_second_record(read):
    first = Function(numbers(1), rsp=(7, -1), ref=(11, 3))
    second = Function(numbers(2), rsp=(7, 1), ref=(11, 2))
    table = read(first, second)
    assert labels(table.responses) == ["7:-tx"]
    np.testing.assert_allclose(table.values[:, 0, 0], first.data, rtol=1e-12)
    np.testing.assert_allclose(table.values[:, 0, 1], -second.data, rtol=1e-12)


def test_two_flipped_ends_leave_the_value(read):
    first = Function(numbers(1), rsp=(7, 1), ref=(11, 3))
    cross = [
        Function(numbers(2), rsp=(7, -1), ref=(3, -1)),
        Function(numbers(3), rsp=(2, 1), ref=(3, 1)),
        Function(numbers(4), rsp=(2, -1), ref=(11, -3)),
    ]
    table = read(first, *cross)
    assert labels(table.references) == ["11:+tz", "3:-tx"]
    np.testing.assert_allclose(table.values[:, 0, 1], -cross[0].data, rtol=1e-12)
    np.testing.assert_allclose(table.values[:, 1, 1], -cross[1].data, rtol=1e-12)
    np.testing.assert_allclose(table.values[:, 1, 0], cross[2].data, rtol=1e-12)


@pytest.mark.parametrize(
    ("rsp", "ref", "si"),
    [
        ((7, 1), (11, 3), 1e-3 / 1e3),  # mm per kN
        ((7, -5), (11, 3), 1 / 1e3),  # rad per kN
        ((7, 1), (11, 4), 1e-3 / (1e3 * 1e-3)),  # mm per kN mm
        ((7, 6), (11, -4), 1 / (1e3 * 1e-3)),  # rad per kN mm
    ],
)
@pytest.mark.parametrize("newline", [b"\n", b"\r\n"], ids=["lf", "crlf"])
def test_millimetres_and_kilonewtons_become_si(read, rsp, ref, si, newline):
    # SI = value / factor: 1000 mm and 0.001 kN make one of SI.
    table = read(units(1e3, 1e-3, newline=newline), replace(ONE, rsp=rsp, ref=ref))
    np.testing.assert_allclose(table.values[:, 0, 0], ONE.data * si, rtol=1e-12)


def test_units_at_the_end_of_the_file_count_too(read):
    table = read(ONE, units(1e3, 2.0))
    np.testing.assert_allclose(table.values[:, 0, 0], ONE.data * 2e-3, rtol=1e-12)


def test_two_joined_files_keep_their_own_units_or_are_refused(read):
    from_mm = replace(ONE, rsp=(7, 1))
    from_m = Function(numbers(5), rsp=(7, 2))
    try:
        table = read(units(1e3, 1.0), from_mm, units(1.0, 1.0), from_m)
    except InputError:
        return
    np.testing.assert_allclose(table.values[:, 0, 0], from_mm.data / 1e3, rtol=1e-12)
    np.testing.assert_allclose(table.values[:, 1, 0], from_m.data, rtol=1e-12)


@pytest.mark.parametrize(
    ("ordinate", "quantity"), [(8, "receptance"), (11, "mobility"), (12, "accelerance")]
)
def test_the_ordinate_type_tells_the_quantity(read, ordinate, quantity):
    assert read(replace(ONE, ordinate=ordinate)).quantity == quantity


@pytest.mark.parametrize("ordinate", [0, 1])
def test_an_unstated_ordinate_takes_the_quantity_of_the_campaign(read, ordinate):
    assert read(replace(ONE, ordinate=ordinate), quantity="mobility").quantity == "mobility"


def test_other_datasets_are_passed_over(read):
    others = [
        dataset("   151", ["model", "", "program", "01-Jan-26  00:00:00", "", "", ""]),
        dataset("    15", [f"{7:10d}{0:10d}{0:10d}{11:10d}" + "".join(["      1.0E+00"] * 3)]),
        dataset("  2411", [f"{7:10d}{0:10d}{0:10d}{11:10d}", "  1.0D+00  2.0D+00  3.0D+00"]),
        dataset(
            "    55",
            [
                *["NONE"] * 5,
                f"{1:10d}{2:10d}{2:10d}{8:10d}{2:10d}{3:10d}",
                f"{2:10d}{4:10d}{0:10d}{1:10d}",
                "".join(f"{v:13.5E}" for v in (120.5, 1.0, 0.02, 0.0)),
                f"{7:10d}",
                "".join(f"{v:13.5E}" for v in (0.1, 0.2, 0.3)),
            ],
        ),
        dataset("  9999", ["a dataset", "of nobody"]),
    ]
    table = read(*others, ONE, others[-1], replace(ONE, rsp=(7, 2)))
    assert labels(table.responses) == ["7:+tx", "7:+ty"]
    np.testing.assert_allclose(table.values[:, 0, 0], ONE.data, rtol=1e-12)


@pytest.mark.parametrize("kind", [0, 1, 2, 3, 5, 9, 12])
def test_functions_that_are_no_frf_and_no_coherence_are_passed_over(read, kind):
    # Also where their axis, direction and node would be refused in an FRF.
    other = Function(numbers(3, 5, real=True), EVEN[:5] + 9, rsp=(0, 0), ref=(0, 0), func=kind)
    table = read(other, ONE, other)
    assert table.values.shape == (9, 1, 1)
    assert labels(table.responses) == ["7:+tx"]


def test_missing_cells_are_masked_and_zero(read):
    functions = {
        (0, 0): Function(numbers(1), rsp=(7, 1), ref=(11, 1)),
        (1, 0): Function(numbers(2), rsp=(7, 2), ref=(11, 1)),
        (2, 1): Function(numbers(3), rsp=(2, 3), ref=(11, 2)),
    }
    table = read(*functions.values())
    assert {tuple(map(int, cell)) for cell in np.argwhere(table.measured)} == set(functions)
    assert not table.values[:, ~table.measured].any()


def coherence_of(function, seed):
    values = np.random.default_rng(seed).uniform(0.1, 0.99, 9)
    return replace(function, data=values, func=6, ordinate=0)


def test_coherences_find_their_cells_in_any_order(read):
    first, second = ONE, Function(numbers(2), rsp=(2, 3))
    table = read(coherence_of(second, 8), first, second, coherence_of(first, 9))
    np.testing.assert_allclose(table.coherence[:, 0, 0], coherence_of(first, 9).data, rtol=1e-11)
    np.testing.assert_allclose(table.coherence[:, 1, 0], coherence_of(second, 8).data, rtol=1e-11)


def test_the_sign_of_a_direction_does_not_flip_a_coherence(read):
    negative = replace(ONE, rsp=(7, -1), ref=(11, -3))
    table = read(ONE, coherence_of(negative, 4))
    np.testing.assert_allclose(table.coherence[:, 0, 0], coherence_of(ONE, 4).data, rtol=1e-11)


def test_units_do_not_touch_a_coherence(read):
    table = read(units(1e3, 1e-3), ONE, coherence_of(ONE, 4))
    np.testing.assert_allclose(table.coherence[:, 0, 0], coherence_of(ONE, 4).data, rtol=1e-11)


def test_a_complex_coherence_counts_by_its_real_part(read):
    values = coherence_of(ONE, 4).data
    table = read(ONE, replace(coherence_of(ONE, 4), data=values + 0j))
    np.testing.assert_allclose(table.coherence[:, 0, 0], values, rtol=1e-11)


def test_cells_without_coherence_say_so(read):
    table = read(ONE, Function(numbers(2), rsp=(2, 3)), coherence_of(ONE, 1))
    assert np.isfinite(table.coherence[:, 0, 0]).all()
    assert np.isnan(table.coherence[:, 1, 0]).all()


def test_with_more_frfs_than_coherences_in_a_cell_none_is_guessed(read):
    table = read(ONE, replace(ONE, data=2 * ONE.data), coherence_of(ONE, 1))
    assert np.isnan(table.coherence[:, 0, 0]).all()
    assert "the first" in table.remarks[0]


def test_coherence_for_all_measured_cells_is_enough(read):
    functions = [ONE, Function(numbers(2), rsp=(2, 3), ref=(11, 1))]  # 2 of 4 cells
    table = read(*functions, *(coherence_of(f, 5 + k) for k, f in enumerate(functions)))
    assert table.coherence is not None
    assert np.isfinite(table.coherence[:, table.measured]).all()


def test_a_coherence_without_its_frf_is_passed_over(read):
    table = read(ONE, coherence_of(ONE, 1), coherence_of(replace(ONE, rsp=(1, 1)), 2))
    assert labels(table.responses) == ["7:+tx"]
    assert table.coherence is not None


def test_rounding_beyond_one_is_clipped_from_a_coherence(read):
    values = coherence_of(ONE, 1).data
    values[3] = 1.0000002
    table = read(ONE, replace(ONE, data=values, func=6))
    assert table.coherence.max() == 1


def written_by_pyuff(path, functions, *, binary):
    for function in functions:
        record = {
            "type": 58,
            "binary": binary,
            "func_type": function.func,
            "rsp_node": function.rsp[0],
            "rsp_dir": function.rsp[1],
            "ref_node": function.ref[0],
            "ref_dir": function.ref[1],
            "data": function.data,
            "x": function.x,
            "abscissa_spacing": int(function.even),
            "abscissa_spec_data_type": 18,
            "ordinate_spec_data_type": function.ordinate,
            "orddenom_spec_data_type": 13,
            "n_bytes": 0,
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves a file open on writing
            pyuff.UFF(str(path)).write_sets(record, "add")
    return path


@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
def test_ascii_of_pyuff_is_read(tmp_path, even):
    x = EVEN if even else UNEVEN
    functions = [
        Function(numbers(6), x, rsp=(7, -2), even=even),
        Function(numbers(7), x, rsp=(2, 3), even=even),
    ]
    table = read_uff(written_by_pyuff(tmp_path / "a.uff", functions, binary=0))
    assert labels(table.responses) == ["7:-ty", "2:+tz"]
    for k, function in enumerate(functions):  # pyuff writes eleven decimals
        np.testing.assert_allclose(table.values[:, k, 0], function.data, rtol=2e-11)


def test_a_58b_of_pyuff_is_read(tmp_path):
    # pyuff announces 8 bytes a value, and a complex double has 16.
    functions = [Function(numbers(6), rsp=(7, -2)), Function(numbers(7), rsp=(2, 3))]
    table = read_uff(written_by_pyuff(tmp_path / "b.uff", functions, binary=1))
    for k, function in enumerate(functions):
        np.testing.assert_array_equal(table.values[:, k, 0], function.data)


def test_pyuff_reads_our_writer_alike(tmp_path):
    # The writer of these tests against a reader that is not ours.
    function = Function(numbers(6), UNEVEN, rsp=(7, -2), even=False, order=">", single=True)
    path = tmp_path / "c.uff"
    path.write_bytes(function.content())
    record = pyuff.UFF(str(path)).read_sets(0)
    assert (record["rsp_node"], record["rsp_dir"], record["ref_dir"]) == (7, -2, 3)
    np.testing.assert_array_equal(record["x"], UNEVEN)
    np.testing.assert_allclose(record["data"], function.data, rtol=1e-7)


@pytest.mark.parametrize("announced", [0, 72, 136, 152, 5000])
def test_a_58b_that_miscounts_its_bytes_is_read_by_the_number_of_its_values(read, announced):
    # 9 complex doubles are 144 bytes, and the end mark stands behind them: pyuff itself writes 72.
    table = read(replace(ONE, order="<", announced_bytes=announced))
    np.testing.assert_array_equal(table.values[:, 0, 0], ONE.data)
