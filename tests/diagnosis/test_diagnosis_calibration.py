"""The committed calibration of the posterior: that of the evidence that is committed."""

from diagnosis.inference.calibration import load_calibration
from tests.bench.calibrate import fit_constants, log_likelihood


def test_the_committed_constants_are_those_of_the_committed_evidence():
    assert fit_constants() == load_calibration()


def test_other_constants_find_the_truth_less_probable():
    constants = load_calibration()
    best = log_likelihood(constants)
    for update in ({"error_values": 1.0}, {"error_values": 100.0}, {"noise_exponent": 1.0}):
        assert log_likelihood(constants.model_copy(update=update)) < best - 1


def test_the_truth_is_probable_in_most_campaigns():
    constants = load_calibration()
    assert constants.campaigns >= 30
    assert log_likelihood(constants) / constants.campaigns > -1.0
