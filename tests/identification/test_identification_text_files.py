"""FRFs and time records from text files: cells, headings, LabVIEW, refusals."""

import re
from pathlib import Path

import numpy as np
import pytest
from array_files import FREQ, OPTIONS, tables
from text_files import labview

from identification.readers.array_files import load_arrays
from identification.readers.array_frfs import read_arrays
from identification.readers.array_records import read_array_records
from identification.readers.text_arrays import read_rate
from identification.readers.text_tables import parse_number
from identification.words import InputError

VALUES, COHERENCE = tables()
COLUMNS = VALUES.swapaxes(1, 2).reshape(len(FREQ), -1)  # each reference with all its channels
ONE = {**OPTIONS, "channels": ["1:+z"], "references": ["1:+z"]}


def write(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def rows(cell, separator, columns=COLUMNS, freq=str):
    return [
        separator.join([freq(f), *map(cell, row)]) for f, row in zip(FREQ, columns, strict=True)
    ]


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("0.1-0.2j", 0.1 - 0.2j),
        ("0.1-0.2i", 0.1 - 0.2j),
        ("(0.1-0.2j)", 0.1 - 0.2j),
        ("0.1+-0.2j", 0.1 - 0.2j),
        ("0.1 - 0.2 i", 0.1 - 0.2j),
        ("0.1 - 0.2*I", 0.1 - 0.2j),
        ("1e-3+2E-4j", 1e-3 + 2e-4j),
        ("1.0D-03", 1e-3),
        ("-2j", -2j),
        ("0,5", 0.5),
        ("0,5-1,5j", 0.5 - 1.5j),
        ("1 2", None),
        ("1,2,3", None),
        ("i", None),
        ("inf", None),
        ("0.1-", None),
        ("__import__('os')", None),
        ("2024-11-28", None),
    ],
)
def test_a_cell_is_a_real_or_complex_number_or_none(text, number):
    assert parse_number(text) == number


@pytest.mark.parametrize("suffix", [".csv", ".txt", ".dat"])
@pytest.mark.parametrize(
    ("separator", "cell", "freq"),
    [
        (";", lambda v: f"{v.real!r}{v.imag:+.17g}j", lambda f: f"{f}+0j"),
        (",", str, str),
        ("\t", lambda v: f"{v.real:.17g}+{v.imag:.17g}i", str),
        ("   ", str, str),
        (";", lambda v: f"{v.real:.17g}{v.imag:+.17g}j".replace(".", ","), lambda f: f"{f},0"[:9]),
        (", ", lambda v: f'"{v.real:.17g} {v.imag:+.17g} i"', str),
    ],
)
def test_complex_cells_are_read_with_each_separator(tmp_path, suffix, separator, cell, freq):
    def plain(value):
        return cell(complex(value))

    axis = (lambda f: str(f).replace(".", ",")) if freq(1) == "1,0" else freq
    path = write(tmp_path / f"t{suffix}", rows(plain, separator, freq=axis))
    table = read_arrays(path, **OPTIONS)
    np.testing.assert_allclose(table.values, VALUES, rtol=1e-15)
    np.testing.assert_array_equal(table.freq_hz, FREQ)
    assert table.coherence is None
    assert not table.remarks


def test_headers_comments_quotes_and_empty_lines_are_no_data(tmp_path):
    body = rows(lambda v: str(complex(v)), ";")
    body[3:3] = ["", "# a comment 1;2"]
    head = ["Tower, visit of 3 May", '"Frequency [Hz]";' + ";".join('"H"' for _ in COLUMNS[0]), "%"]
    table = read_arrays(write(tmp_path / "t.csv", [*head, *body]), **OPTIONS)
    np.testing.assert_array_equal(table.values, VALUES)


def test_a_column_of_row_numbers_without_heading_is_left_out(tmp_path):
    body = [f"{k},{row}" for k, row in enumerate(rows(lambda v: str(complex(v)), ","))]
    head = ",frequency," + ",".join(f"H{k}" for k in range(COLUMNS.shape[1]))
    table = read_arrays(write(tmp_path / "t.csv", [head, *body]), **OPTIONS)
    np.testing.assert_array_equal(table.freq_hz, FREQ)
    np.testing.assert_array_equal(table.values, VALUES)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
def test_headings_may_be_written_in_other_encodings(tmp_path, encoding):
    path = tmp_path / "t.csv"
    h = COLUMNS[:, 0]
    body = [f"{f};{a};{b}" for f, a, b in zip(FREQ, h.real, h.imag, strict=True)]
    text = "\r\n".join(["Frequency [Hz];re [mm/s²/N];im [mm/s²/N]", *body])
    path.write_bytes(text.encode(encoding))
    table = read_arrays(path, **ONE)
    np.testing.assert_allclose(table.values[:, 0, 0], 1e-3 * h, rtol=1e-13)


def real_table(path, headings, *columns):
    body = [
        ",".join(f"{v:.17g}" for v in row) for row in np.column_stack([FREQ, *columns]).tolist()
    ]
    return write(path, [*headings, *body])


@pytest.mark.parametrize(
    ("heading", "make"),
    [
        ("f,re,im", lambda h: (h.real, h.imag)),
        ("Frequency (Hz),Imaginary,Real part", lambda h: (h.imag, h.real)),
        ("# f,H_mag,H_phase", lambda h: (abs(h), np.angle(h, deg=True))),
        ("f,Magnitude (m/s^2/N),Phase (rad)", lambda h: (abs(h), np.angle(h))),
    ],
)
def test_pairs_of_columns_are_named_by_headings(tmp_path, heading, make):
    h = COLUMNS[:, 0]
    table = read_arrays(real_table(tmp_path / "t.csv", [heading], *make(h)), **ONE)
    np.testing.assert_allclose(table.values[:, 0, 0], h, rtol=1e-13)


def test_a_coherence_column_and_units_of_headings_count(tmp_path):
    h, g2 = COLUMNS[:, 0], COHERENCE[:, 0, 0]
    head = ["Frequency [rad/s],real [g/N],imag [g/N],coherence"]
    path = real_table(tmp_path / "t.csv", head, h.real, h.imag, g2)
    table = read_arrays(path, **ONE)
    np.testing.assert_allclose(table.values[:, 0, 0], 9.80665 * h)
    np.testing.assert_allclose(table.freq_hz, FREQ / (2 * np.pi))
    np.testing.assert_array_equal(table.coherence[:, 0, 0], g2)
    assert any("g/N" in remark for remark in table.remarks)
    assert any("rad/s" in remark for remark in table.remarks)
    stated = read_arrays(path, **{**ONE, "unit": "m/s^2/N"}, frequency_unit="Hz")
    np.testing.assert_allclose(stated.values[:, 0, 0], h)
    np.testing.assert_array_equal(stated.freq_hz, FREQ)


def test_pairs_without_headings_are_parts_only_where_the_first_is_negative_somewhere(tmp_path):
    h = COLUMNS[:, 0]
    table = read_arrays(real_table(tmp_path / "t.csv", [], h.real, h.imag), **ONE)
    np.testing.assert_array_equal(table.values[:, 0, 0], h)
    assert "real and imaginary" in table.remarks[0]
    path = real_table(tmp_path / "m.csv", [], abs(h), np.angle(h, deg=True))
    with pytest.raises(InputError, match="add a header line with re and im, or mag and phase"):
        read_arrays(path, **ONE)


def test_columns_are_chosen_by_heading_or_number(tmp_path):
    body = rows(lambda v: str(complex(v)), ",")
    head = "f," + ",".join(f"H{k}" for k in range(1, COLUMNS.shape[1] + 1))
    path = write(tmp_path / "t.csv", [head, *body])
    options = {**OPTIONS, "channels": ["1:+x", "2:+x"], "references": ["1:+x"]}
    table = read_arrays(path, **options, columns=["H3", 1])
    np.testing.assert_array_equal(table.values[:, :, 0], COLUMNS[:, [2, 0]])
    with pytest.raises(InputError, match=r"no column 'H99'.*correct columns"):
        read_arrays(path, **options, columns=["H3", "H99"])


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["1;0.1;2", "2;0.1"], "line 2 has 2 cells, but the first row has 3: complete the row"),
        (["f;a", "1;0.1", "2;abc"], "line 3, column 2: 'abc' is no number"),
        (["f;a", "1;abc", "2;0.1"], "line 2, column 2: 'abc' is no number"),
        (["1;0.1", "2;nan"], "line 2, column 2: 'nan' is no number"),
        (["1;0.1", "2;nan+nanj"], "line 2, column 2: 'nan[+]nanj' is no number"),
        (["1;0.1", "2;1e99"], "line 2, column 2: '1e99' is no number up to 1e[+]30"),
        (["1;0.1", "2;"], "line 2 has 1 cells"),
        (["1;0.1", "3;0.1", "2;0.1"], "line 3: the first column does not increase, 2 after 3"),
        (["1;0.1", "1;0.2"], "line 2: the first column does not increase, 1 after 1"),
        (["1+1j;0.1", "2;0.2"], "line 1: the first column, 1[+]1j, is complex"),
        (["1;0.1", '2;"' + "9" * 200_000], "line 2, column 2"),
        (["1;0.1", "2;1_0"], "'1_0' is no number"),
        (["only words here"], "has no row of numbers"),
        ([""], "has no row of numbers"),
        (["f;re", "1;0.1"], "headings name columns 1 of real: give re and im"),
        (["f;re;b", "1;0.1;2"], "headings name columns 1 of no part, 1 of real"),
        (["f;re;im", "1;0.1j;2"], "the heading of a part or coherence holds complex"),
        (["f;mag (dB);phase", "1;0.1;2"], "names magnitude: export real"),
        (["f;real imag", "1;0.1"], "names real and imaginary: export real"),
        (["1;0.1j;2", "2;0.1;1"], "columns of 2 FRFs, but 1 channels and 1 references need 1"),
    ],
)
def test_a_broken_table_is_refused_with_its_line_and_a_remedy(tmp_path, lines, message):
    path = write(tmp_path / "t.csv", lines)
    with pytest.raises(InputError, match=message) as caught:
        read_arrays(path, **ONE)
    assert str(caught.value).startswith(str(path))
    assert ": " in str(caught.value).removeprefix(str(path))
    assert "\n" not in str(caught.value)


def test_a_text_beyond_the_limit_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "t.csv"
    with path.open("wb") as file:
        file.truncate(2**28 + 1)  # a hole: no memory, no disk
    with pytest.raises(InputError, match=r"256 MiB of text, more than 256: save its numbers"):
        load_arrays(path)


def records(count=2, samples=50):
    return np.random.default_rng(3).normal(size=(count, 3, samples))


NAMES = ("Acc 1", "Hammer", "Acc 2")


@pytest.mark.parametrize("x_columns", ["No", "One", "Multi"])
@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), ("\t", ","), (",", ".")])
def test_sections_of_a_labview_file_are_records(tmp_path, x_columns, separator, decimal):
    signals = records()
    text = labview(
        signals,
        256.0,
        names=NAMES,
        units=("g", "N", "g"),
        x_columns=x_columns,
        separator=separator,
        decimal=decimal,
    )
    path = tmp_path / "t.lvm"
    path.write_text(text)
    options = {**ONE, "channels": ["1:+z", "2:+z"]}
    (record,) = read_array_records(path, load_arrays(path), **options)
    np.testing.assert_allclose(record.force, signals[:, 1], rtol=1e-8)
    np.testing.assert_allclose(record.motion, 9.80665 * signals[:, [0, 2]], rtol=1e-8)
    assert record.rate_hz == pytest.approx(256.0, rel=1e-9)
    assert len(record.remarks) == 1  # on the unit
    assert "g/N" in record.remarks[0]


def test_a_force_that_nothing_names_is_the_first_column_with_a_remark(tmp_path):
    path = tmp_path / "t.lvm"
    path.write_text(labview(records(), 256.0, names=("U 0", "U 1", "U 2"), units=("V", "V", "V")))
    options = {**ONE, "channels": ["1:+z", "2:+z"]}
    (record,) = read_array_records(path, load_arrays(path), **options)
    np.testing.assert_allclose(record.force, records()[:, 0], rtol=1e-8)
    assert "counts as the force" in record.remarks[0]
    assert "V/V" in record.remarks[1]
    arrays = load_arrays(path, ["U 2", 1, 2])
    np.testing.assert_allclose(arrays["force"], records()[:, 2], rtol=1e-8)
    np.testing.assert_allclose(arrays["response"], records()[:, :2], rtol=1e-8)
    assert "force_label" not in arrays


def test_a_letter_n_in_a_heading_does_not_make_a_force(tmp_path):
    path = write(tmp_path / "t.csv", ["t [s],F,acc N1", "0,1,2", "1,3,4", "2,5,7"])
    arrays = load_arrays(path)
    np.testing.assert_array_equal(arrays["force"], [[1, 3, 5]])
    assert arrays["force_label"] == "F"


def test_time_in_the_first_column_of_a_csv_makes_a_record(tmp_path):
    signal = records(1)[0]
    body = [f"{k / 256},{a},{b},{c}" for k, (a, b, c) in enumerate(signal.T)]
    path = write(tmp_path / "t.csv", ["Time (s),Force (N),a1 (g),a2 (g)", *body])
    arrays = load_arrays(path)
    np.testing.assert_allclose(arrays["force"], signal[:1])
    np.testing.assert_allclose(arrays["response"], signal[None, 1:])
    assert arrays["rate_hz"] == pytest.approx(256.0)
    assert arrays["unit_label"] == "g/N"
    body[7] = "0.5" + body[7][body[7].index(",") :]
    with pytest.raises(InputError, match="line 10: the first column does not increase"):
        load_arrays(write(path, ["Time (s),Force (N),a1 (g),a2 (g)", *body]))


def test_a_labview_table_over_frequency_holds_frfs(tmp_path):
    h = COLUMNS[:, 0]
    path = tmp_path / "t.lvm"
    path.write_text(
        labview(
            [[h.real, h.imag]],
            2.0,
            names=("FRF (Real)", "FRF (Imaginary)"),
            units=("g/N", "g/N"),
            dimension="Frequency",
            start=10.0,
        )
    )
    table = read_arrays(path, **ONE)
    np.testing.assert_allclose(table.values[:, 0, 0], 9.80665 * h, rtol=1e-8)
    np.testing.assert_allclose(table.freq_hz, 10 + np.arange(len(FREQ)) / 2)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("LabVIEW Measurement", "Something", "is no LabVIEW measurement file"),
        (r"\*\*\*End_of_Header\*\*\*", "", "is no LabVIEW measurement file"),
        ("Channels\t3", "Channels\t999999999999", "0 channels"),
        ("Channels\t3", "Channels\t-3", "0 channels"),
        ("Channels\t3", "Channels", "0 channels"),
        ("Channels\t3", "Channels\tnan", "0 channels"),
        ("Channels\t3", "Channels\t4", "5 headings, but 4 channels"),
        ("Channels", "Kanaele", "has no line Channels"),
        ("X_Columns\tNo", "X_Columns\tSome", "No, One or Multi"),
        ("X0\t0", "X0\t7", "X0 is missing or differs"),
        ("Delta_X", "Delta", "Delta_X is missing or differs"),
        ("Delta_X\t[^\n]*", "Delta_X\t0\t0\t0", "Delta_X is 0"),
        ("X_Dimension\tTime", "X_Dimension\tFrequency", "mixes Frequency and Time"),
        ("\n\t[-0-9][^\n]*\n\n", "\n\tx\t1\t2\n\n", "'x' is no number"),
        ("\n\t[-0-9][^\n]*\n\n", "\n\t1\n\n", "has 2 cells, but the first row has 4"),
        ("\n\t[-0-9][^\n]*\n\n", "\n\n", "sections have the shapes"),
    ],
)
def test_a_broken_labview_file_is_refused_in_one_sentence(tmp_path, old, new, message):
    path = tmp_path / "t.lvm"
    text = labview(records(), 256.0, names=NAMES, units=("g", "N", "g"))
    count = 0 if old.startswith((r"\*", "Channels$")) or old == "Channels" else 1
    path.write_text(re.sub(old, new, text, count=count))
    with pytest.raises(InputError, match=message) as caught:
        load_arrays(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_block_of_another_program_within_a_labview_file_is_passed_over(tmp_path):
    text = labview(records(), 256.0, names=NAMES, units=("g", "N", "g"))
    special = "***Start_Special***\nanything 1 2 3\n***End_Special***\n"
    path = tmp_path / "t.lvm"
    path.write_text(text.replace("Channels", special + "Channels", 1))
    np.testing.assert_allclose(load_arrays(path)["force"], records()[:, 1], rtol=1e-8)


def test_files_of_one_rate_have_one_rate_whatever_their_printed_times_begin_with():
    samples = np.arange(4096)
    for start in (0.0, 0.0123457, 1234.567891):
        assert read_rate(Path("a.csv"), np.round(start + samples / 1024, 6), 1.0) == 1024.0
    rate = read_rate(Path("a.csv"), np.round(samples / 1024.01, 6), 1.0)
    assert rate == pytest.approx(1024.01, rel=1e-6)
    assert rate != 1024.0
