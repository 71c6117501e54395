"""Coherences in per cent, above 1, negative, complex or constant: refused or told, never used."""

from pathlib import Path

import numpy as np
import pytest

from identification.readers.frf_table import FrfTable, check_coherence, real_coherence
from identification.words import Dof, InputError

SHAPE = (50, 2, 1)
FILE = Path("t.mat")


def table(coherence):
    return FrfTable(
        freq_hz=np.arange(1.0, 51.0),
        values=np.ones(SHAPE, complex),
        coherence=coherence,
        measured=np.ones(SHAPE[1:], bool),
        responses=(Dof.parse("1:+tx"), Dof.parse("2:+tx")),
        references=(Dof.parse("1:+tx"),),
        quantity="accelerance",
    )


@pytest.fixture
def coherence():
    return np.random.default_rng(1).uniform(0.6, 0.999, SHAPE)


def test_rounding_beyond_one_and_zero_counts_as_one_and_zero(coherence):
    coherence[3, 0, 0], coherence[4, 1, 0] = 1 + 9e-5, -9e-5
    checked = check_coherence(FILE, table(real_coherence("t.mat", coherence)))
    assert checked.coherence[3, 0, 0] == 1.0
    assert checked.coherence[4, 1, 0] == 0.0
    assert checked.remarks == ()


def test_per_cent_is_refused_with_the_remedy(coherence):
    with pytest.raises(InputError, match=r"t\.mat: .* as in per cent: divide it by 100"):
        check_coherence(FILE, table(100 * coherence))


@pytest.mark.parametrize("value", [1.25, -0.3, 1e6])
def test_a_few_values_outside_count_as_unknown(coherence, value):
    coherence[7, 1, 0] = value
    checked = check_coherence(FILE, table(coherence))
    assert np.isnan(checked.coherence[7, 1, 0])
    assert np.isfinite(checked.coherence).sum() == coherence.size - 1
    (remark,) = checked.remarks
    assert "8 Hz, response 2:+tx, reference 1:+tx), whose noise counts as unknown" in remark


@pytest.mark.parametrize("value", [1.2, -0.3])
def test_many_values_outside_are_refused(coherence, value):
    coherence[:10] = value
    with pytest.raises(InputError, match="outside 0 to 1 in 20 % of its values"):
        check_coherence(FILE, table(coherence))


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0, 100.0])
def test_a_constant_coherence_is_not_used(value):
    checked = check_coherence(FILE, table(np.full(SHAPE, value)))
    assert checked.coherence is None
    assert f"its coherence is {value:g} on every line" in checked.remarks[0]


def test_a_complex_coherence_is_refused_unless_it_is_real(coherence):
    np.testing.assert_array_equal(real_coherence("t", coherence + 0j), coherence)
    with pytest.raises(InputError, match="COHs is complex"):
        real_coherence("t.mat: COHs", coherence + 0.1j)
