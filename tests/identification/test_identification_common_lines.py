"""Tests on different frequency lines: those that all have count, unless axes meet by chance."""

import numpy as np
import pytest

from identification.readers.frequency_lines import keep_common_lines
from identification.words import Condition, Dof, Frf, FrfEstimate, Test

DOF = Dof.parse("acc1:+tx")


def measured(name, freq_hz):
    """A test whose values are its frequencies."""
    freq = np.asarray(freq_hz, float)
    values = freq[:, None, None].astype(complex)
    frf = Frf(freq, values, (DOF,), (DOF,), "accelerance")
    estimate = FrfEstimate(frf, 0.01 * np.ones(values.shape), "differences", np.ones((1, 1), bool))
    return Test(Condition(name, DOF), estimate)


@pytest.mark.parametrize(
    ("first", "second", "common"),
    [
        (np.arange(1, 41) / 4, np.arange(9, 101) / 4, np.arange(9, 41) / 4),  # another band
        (np.arange(1, 41) / 4, np.arange(1, 21) / 2, np.arange(1, 21) / 2),  # a finer spacing
        (np.arange(1, 41) / 3, np.round(np.arange(5, 41) / 3, 8), np.arange(5, 41) / 3),  # a text
    ],
)
def test_the_lines_that_all_tests_have_count(first, second, common):
    tests, remarks = keep_common_lines([measured("a.uff", first), measured("b.uff", second)])
    axes = [test.estimate.frf.freq_hz for test in tests]
    assert np.array_equal(*axes)
    assert axes[0] == pytest.approx(common, abs=1e-7)
    for test in tests:
        assert test.estimate.frf.values[:, 0, 0].real == pytest.approx(common, abs=1e-7)
        assert test.estimate.variance.shape == (len(common), 1, 1)
    (remark,) = remarks
    assert f"the {len(common)} count" in remark
    assert "40 of a.uff" in remark


def test_one_axis_needs_no_remark():
    axis = np.arange(1, 41) / 4
    tests, remarks = keep_common_lines([measured("a.uff", axis), measured("b.uff", axis)])
    assert remarks == ()
    assert all(np.array_equal(test.estimate.frf.freq_hz, axis) for test in tests)


@pytest.mark.parametrize("axis", [np.arange(1, 41) * 0.3, np.arange(41, 81) / 4, [5.0]])
def test_axes_that_meet_by_chance_stay_apart_to_be_refused(axis):
    given = [measured("a.uff", np.arange(1, 41) / 4), measured("b.uff", axis)]
    tests, remarks = keep_common_lines(given)
    assert remarks == ()
    assert len(tests[1].estimate.frf.freq_hz) == len(axis)
