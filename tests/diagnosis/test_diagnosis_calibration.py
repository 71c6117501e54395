"""The committed calibration of the posterior: that of the evidence that is committed."""

import numpy as np
import pytest

from diagnosis.inference.calibration import load_calibration
from tests.bench.calibrate import MIN_TRUTH_PROBABILITY, fit_constants, log_likelihood
from tests.bench.posterior_rules import RULES, weigh_rows


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


def test_the_posterior_finds_the_truth_less_probable_without_each_price():
    def count_nats(name):
        stated = np.maximum(weigh_rows(RULES[name]), MIN_TRUTH_PROBABILITY)
        return -np.log(stated).mean()

    constants = load_calibration()
    every = count_nats("all rules")
    assert every == pytest.approx(-log_likelihood(constants) / constants.campaigns)
    for rule in ("parameters", "hypotheses"):
        assert count_nats(f"{rule} are free of charge") > every + 0.2
