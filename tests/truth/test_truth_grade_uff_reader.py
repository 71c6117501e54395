"""The reader of universal files: reads what this package writes, and refuses the rest."""

from dataclasses import replace

import numpy as np
import pytest

from truth.errors import TruthError
from truth.grade.uff_reader import read_uff
from truth.measure import Measurement
from truth.uff import uff_bytes

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
        (GOOD[:-200], "ends within its data|expected a line|no UFF"),
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
