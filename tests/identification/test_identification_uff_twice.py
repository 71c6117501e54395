"""Records that are there twice, and cells without coherence, in a universal file."""

from dataclasses import replace

import numpy as np
import pytest
from identification_examples import Function, numbers

from identification.readers.uff_frfs import read_uff

ONE = Function(numbers(1))
TWO = Function(numbers(2), rsp=(7, 2))
GOOD, POOR = (replace(ONE, func=6, data=np.linspace(low, 0.95, 9)) for low in (0.9, 0.1))


@pytest.fixture
def read(tmp_path):
    def write(*functions):
        path = tmp_path / "test.uff"
        path.write_bytes(b"".join(function.content() for function in functions))
        return read_uff(path)

    return write


@pytest.mark.parametrize(
    "second",
    [ONE, replace(ONE, rsp=(7, -1), data=-ONE.data), replace(ONE, ref=(11, -3), data=-ONE.data)],
    ids=["same", "response turned", "reference turned"],
)
def test_a_record_written_twice_counts_once_and_is_named(read, second) -> None:
    table = read(ONE, TWO, second)
    np.testing.assert_allclose(table.values[:, 0, 0], ONE.data, rtol=1e-12)
    (remark,) = table.remarks
    assert "records 1, 3" in remark
    assert "are identical" in remark
    assert "7:" in remark


def test_of_two_unlike_records_that_with_the_better_coherence_is_used(read) -> None:
    other = replace(ONE, data=1.1 * ONE.data)
    table = read(ONE, other, POOR, GOOD)
    np.testing.assert_allclose(table.values[:, 0, 0], 1.1 * ONE.data, rtol=1e-12)
    np.testing.assert_allclose(table.coherence[:, 0, 0], GOOD.data, rtol=1e-12)
    (remark,) = table.remarks
    assert "differ by up to 9.1 %" in remark
    assert "record 2 is used, its coherence is best" in remark


def test_without_coherence_the_first_of_two_records_is_used(read) -> None:
    table = read(ONE, replace(ONE, data=1.1 * ONE.data))
    np.testing.assert_allclose(table.values[:, 0, 0], ONE.data, rtol=1e-12)
    assert "record 1 is used" in table.remarks[0]


def test_a_file_without_repetition_has_no_remark(read) -> None:
    assert read(ONE, TWO, GOOD).remarks == ()


def test_a_cell_without_coherence_does_not_take_it_from_the_others(read) -> None:
    table = read(ONE, TWO, GOOD)
    np.testing.assert_allclose(table.coherence[:, 0, 0], GOOD.data, rtol=1e-12)
    assert np.isnan(table.coherence[:, 1, 0]).all()
