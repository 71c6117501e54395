"""The reader of universal files: reads what this package writes, and refuses the rest."""

from dataclasses import replace

import numpy as np
import pytest

from truth.campaign.file_formats import uff_bytes
from truth.campaign.measure import Measurement
from truth.errors import TruthError
from truth.grade.uff_reader import read_uff

SHAPE = (7, 3, 2)
RESPONSES, REFERENCES = ((4, 1), (4, 3), (12, 2)), ((11, 2), (7, 1))


def measurement(coherence=True):
    random = np.random.default_rng(5)
    frf = random.standard_normal(SHAPE) + 1j * random.standard_normal(SHAPE)
    known = random.uniform(0, 1, SHAPE) if coherence else None
    return Measurement(2.5 + 0.125 * np.arange(7), frf, known, RESPONSES, REFERENCES)


GOOD = uff_bytes(measurement())
END = b"    -1\n"


def read(content, tmp_path):
    (tmp_path / "test.uff").write_bytes(content)
    return read_uff(tmp_path / "test.uff")


def records():
    """The datasets of GOOD: units, then an FRF and its coherence for each cell."""
    parts = GOOD.split(END + END)
    return [part if part.startswith(END) else END + part for part in parts]


def joined(parts):
    return (END + b"").join(part.removesuffix(END) for part in parts) + END


@pytest.mark.parametrize("coherence", [True, False])
def test_what_is_written_is_read_again(coherence, tmp_path):
    written = measurement(coherence)
    found = read(uff_bytes(written), tmp_path)
    np.testing.assert_allclose(found.freq_hz, written.freq_hz)
    np.testing.assert_allclose(found.frf, written.frf, rtol=1e-6)
    assert found.present.all()
    assert (found.responses, found.references) == (RESPONSES, REFERENCES)
    if coherence:
        np.testing.assert_allclose(found.coherence, written.coherence, rtol=1e-6)
    else:
        assert found.coherence is None


def test_missing_cells_are_masked(tmp_path):
    parts = records()
    del parts[3:5]  # second response, first reference: the FRF and its coherence
    found = read(joined(parts), tmp_path)
    expected = np.ones(SHAPE[1:], bool)
    expected[found.responses.index((4, 3)), 0] = False
    np.testing.assert_array_equal(found.present, expected)
    assert not found.frf[:, ~expected].any()


def test_a_direction_may_be_negative(tmp_path):
    content = GOOD.replace(b"         4   3       NONE", b"         4  -3       NONE")
    assert (4, -3) in read(content, tmp_path).responses


def test_a_coherence_without_its_frf_is_left_out(tmp_path):
    parts = records()
    del parts[11]  # the last cell's FRF
    found = read(joined(parts), tmp_path)
    assert not found.present[2, 1]
    assert found.present.sum() == 5


def test_a_response_with_a_coherence_alone_is_left_out(tmp_path):
    parts = records()
    del parts[11], parts[5]  # the FRFs of the last response
    found = read(joined(parts), tmp_path)
    assert found.responses == RESPONSES[:2]
    assert found.present.all()


def test_fields_are_read_by_their_columns(tmp_path):
    # Every field filled to its width, so that one column more or less is another number.
    values = np.array([1 + 2j, 3 - 1j], "<c8")
    head = "    58b" + "000001000002000000000011000000000016" + "9" * 36
    place = "00004" + "9" * 25 + " ABCDEFGHIJ1234567890-003 ABCDEFGHIJ2345678901-002" + "9" * 6
    data = "0000000005" + "0000000002" + "0000000001" + "2.5000000e+001.2500000e-01" + "9" * 13
    axes = ["0000000018" + "9" * 20, "0000000012" + "9" * 20, "0000000013" + "9" * 20, "9" * 30]
    lines = [head, *["text"] * 5, place, data, *axes]
    ascii_part = "".join(f"{line}\n" for line in lines).encode()
    found = read(END + ascii_part + values.tobytes() + b"\n" + END, tmp_path)
    assert (found.responses, found.references) == (((1234567890, -3),), ((2345678901, -2),))
    np.testing.assert_array_equal(found.freq_hz, [2.5, 2.625])
    np.testing.assert_array_equal(found.frf[:, 0, 0], values)


CHANGES = {
    "ascii": (b"    58b     1", b"    58      1", "dataset 58: is not handled"),
    "big endian": (b"    58b     1     2", b"    58b     2     2", "little-endian"),
    "other units": (b"         1SI", b"         2SI", "expected SI"),
    "a time record": (b"\n    4         0", b"\n    1         0", "function type 1"),
    "uneven lines": (b"         5         7         1", b"         5         7         0", "even"),
    "double": (b"         5         7", b"         6         7", "single precision"),
    "one line more": (b"         5         7", b"         5         8", "single precision"),
    "mobility": (b"\n        12    0", b"\n        11    0", "no acceleration over a force"),
    "a rotation": (b"         4   3 ", b"         4   4 ", "direction 4"),
    "no direction": (b"         4   3 ", b"         4   0 ", "direction 0"),
    "no number": (b"         4   3 ", b"      four   3 ", "no UFF file"),
    "another grid": (
        b"  2.50000e+00  1.25000e-01",
        b"  2.50000e+00  2.50000e-01",
        "different lines",
    ),
    "lost end": (END + END, END, "damaged|expected a line -1"),
}


@pytest.mark.parametrize("case", CHANGES)
def test_other_files_are_refused(case, tmp_path):
    before, after, words = CHANGES[case]
    assert before in GOOD
    with pytest.raises(TruthError, match=f"test.uff: .*({words})"):
        read(GOOD.replace(before, after, 1), tmp_path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "holds no FRF"),
        (b"text", "expected a line -1"),
        (GOOD[:-9], "ends within its data"),
        (GOOD[:-7], "a dataset is damaged"),
        (GOOD + joined(records()[1:2]), "is given twice"),
        (joined([*records()[:2], *records()[3:]]), "some FRFs have a coherence, others not"),
        (uff_bytes(replace(measurement(), frf=np.full(SHAPE, np.nan + 0j))), "not finite"),
    ],
)
def test_damaged_files_are_refused(content, words, tmp_path):
    with pytest.raises(TruthError, match=words):
        read(content, tmp_path)


def test_a_file_that_is_cut_anywhere_raises_no_other_error(tmp_path):
    # Cut at each byte of the first 3000: never another error.
    cuts = 0
    for size in range(1, 3000, 7):
        try:
            read(GOOD[:size], tmp_path)
        except TruthError:
            cuts += 1
    assert cuts > 400


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(TruthError, match="cannot be read"):
        read_uff(tmp_path / "none.uff")
