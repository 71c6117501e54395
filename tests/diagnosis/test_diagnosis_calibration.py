"""The committed calibration of the judgement: whole, and of the evidence that is committed."""

import numpy as np

from diagnosis.calibration import calibrated
from tests.bench.calibrate import dealt, provenance
from tests.bench.diagnosis import made


def test_the_committed_calibration_says_where_it_comes_from():
    by = calibrated()
    assert by.campaigns >= 50
    assert by.command
    assert by.seeds.startswith("80000")
    values = [by.hidden_width, by.left_width, by.least, by.temper, by.share, by.sure]
    assert np.isfinite(values).all()
    assert min(*values, *by.hidden.values(), *by.left.values()) > 0


def test_the_committed_calibration_is_that_of_the_committed_evidence(monkeypatch):
    monkeypatch.setenv("KEPT", "1")
    decks = dealt()
    told = provenance(decks, [made(one) for one in decks])
    assert told["campaigns"] > 400
    assert told.items() <= calibrated().model_dump().items()
