"""The committed calibration of the judgement: whole, and of the evidence that is committed."""

import numpy as np

from diagnosis.inference.calibration import load_calibration
from tests.bench.calibrate import dealt, given_of, provenance, sure
from tests.bench.diagnosis import made


def test_the_committed_calibration_says_where_it_comes_from():
    by = load_calibration()
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
    assert told.items() <= load_calibration().model_dump().items()


def test_what_leaves_no_doubt_is_as_sure_as_calibration_campaigns_say(monkeypatch):
    monkeypatch.setenv("KEPT", "1")
    given = [one for deck in dealt() for row in made(deck) if (one := given_of(row)) is not None]
    by = load_calibration()
    assert by.sure == sure(by, given) > 0.98
    # The rule of succession: of none it is one half, of n that are all wrong 1 / (n + 2).
    assert sure(by, []) == 0.5
    assert sure(by, [(seen, ()) for seen, _ in given]) < 0.01
