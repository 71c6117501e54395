"""Reading a table of modes: columns and units that count, and one sentence for each fault."""

import pytest

from identification.readers.mode_table import read_mode_table
from identification.words import InputError


def read(folder, text):
    path = folder / "modes.csv"
    path.write_text(text, encoding="utf-8")
    return read_mode_table(path)


def test_rows_come_by_rising_frequency_with_their_lines_in_the_file(tmp_path):
    table = read(
        tmp_path,
        "# of a report\n"
        "frequency,damping,body,direction\n"
        "69.8,0.043,spindle,z\n"
        "\n"
        "11.9,,,\n"
        "124.2,0.028,hexapod,tx + ty\n",
    )
    assert [(mode.line, mode.freq_hz, mode.damping) for mode in table.modes] == [
        (5, 11.9, None),
        (3, 69.8, 0.043),
        (6, 124.2, 0.028),
    ]
    assert [mode.motion for mode in table.modes] == ["", "spindle:tz", "hexapod:tx+ty"]
    assert table.remarks == ()


def test_per_cent_stands_in_the_name_of_the_column(tmp_path):
    table = read(tmp_path, "Damping/%,frequency/Hz,damping_sd/%,frequency_sd\n12.2,11.9,0.5,0.1\n")
    [mode] = table.modes
    assert (mode.damping, mode.damping_sd) == pytest.approx((0.122, 0.005), rel=1e-14)
    assert (mode.freq_hz, mode.freq_sd_hz) == (11.9, 0.1)


def test_columns_that_do_not_count_are_named(tmp_path):
    # So is a misspelt one; modes.csv of mbw identify has many.
    table = read(tmp_path, "mode,frequency,dampnig\n1,11.9,0.1\n")
    assert table.remarks == ("modes.csv: columns that do not count: mode, dampnig",)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "modes.csv is empty"),
        ("frequency,damping\n", "has no mode: add one row"),
        ("f,zeta\n10,0.1\n", "row 1 names no column frequency, but 'f', 'zeta'"),
        ("frequency;damping\n10;0.1\n", "row 1 names no column frequency, .* separated by commas"),
        ("frequency,frequency/Hz\n10,10\n", "row 1: there are two columns frequency"),
        ("damping,damping/%,frequency\n", "row 1: there are two columns damping"),
        ("frequency,damping\n10,0.1\n20\n", "row 3 has 1 cells, but there are 2 columns"),
        ("frequency,damping\n10,0.1,7\n", "row 2 has 3 cells, but there are 2 columns"),
        ("frequency\nabc\n", "row 2: frequency 'abc' is no number"),
        ("frequency\nnan\n", "row 2: frequency 'nan' is no number"),
        ("frequency\n1e999\n", "row 2: frequency '1e999' is no number"),
        ("frequency\n-10\n", "row 2: frequency '-10' is no natural frequency"),
        ("frequency\n0\n", "row 2: frequency '0' is no natural frequency"),
        ("frequency\n1e12\n", "row 2: frequency '1e12' is no natural frequency"),
        ("frequency,damping\n,0.1\n", "row 2: frequency '' is no natural frequency"),
        ("frequency,damping\n10,12.2\n", "row 2: damping '12.2' .* name the column damping/%"),
        ("frequency,damping\n10,0\n", "row 2: damping '0' is no damping ratio"),
        ("frequency,damping/%\n10,130\n", "row 2: damping '130' is no damping ratio"),
        ("frequency,frequency_sd\n10,0\n", "row 2: frequency_sd '0' is no standard deviation"),
        ("frequency,damping,damping_sd\n10,0.1,-1\n", "row 2: damping_sd '-1' is no standard"),
        ("frequency,body,direction\n10,a,up\n", "row 2: direction 'up' is none of tx, ty"),
        ("frequency,body,direction\n10,a,xy\n", "row 2: direction 'xy' is none of tx, ty"),
        ("frequency,body,direction\n10,a,tx+rx\n", "row 2: direction 'tx\\+rx' is none of"),
        ("frequency,body,direction\n10,a,\n", "row 2 states a body or a direction alone"),
        ("frequency,body,direction\n10,,tx\n", "row 2 states a body or a direction alone"),
    ],
)
def test_a_malformed_table_is_refused_with_its_file_and_row(tmp_path, text, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "modes.csv"))
    assert caught.value.exit_code == 3


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "modes.csv"
    path.write_bytes(b"frequency\n\xff\xfe\n")
    with pytest.raises(InputError, match="line 2 is not UTF-8"):
        read_mode_table(path)


@pytest.mark.parametrize(
    ("heading", "values", "doubt"),
    [
        (
            "damping/%",
            (0.0186, 0.0178, 0.0421),
            "values are ratios, name the column damping",
        ),
        ("damping/%", (1.86, 0.0178, 4.21), None),
        ("damping/%", (0.00004, 0.00005, 0.0001), None),  # a tuning fork: no ratio is so small
        ("damping", (0.0186, 0.0178, 0.0421), None),
        ("damping", (0.5, 0.8, 0.9), "if the values are per cent, name the column damping/%"),
        ("damping", (0.5, 0.8, 0.02), None),
    ],
)
def test_a_heading_that_makes_all_damping_implausible_is_doubted(tmp_path, heading, values, doubt):
    rows = "".join(f"{20 + 10 * k},{value}\n" for k, value in enumerate(values))
    remarks = read(tmp_path, f"frequency/Hz,{heading}\n{rows}").remarks
    assert len(remarks) == (doubt is not None)
    assert doubt is None or remarks[0].endswith(doubt)
