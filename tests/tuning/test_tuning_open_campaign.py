"""The open campaign without an effect: tolerances alone are off, so that noise alone remains."""

from dataclasses import replace
from pathlib import Path

import pytest

from tuning import channel_gaps, fit, open_session, predict, random_starts, summarise

NONE = Path(__file__).resolve().parents[3] / "shared" / "campaigns" / "open" / "none"


@pytest.mark.skipif(not NONE.exists(), reason="the shared campaigns are not beside the clone")
def test_every_start_reaches_the_noise():
    session = open_session(NONE)
    model, campaign = session.model, session.campaign.lines(slice(2, None, 5))
    session = replace(session, campaign=campaign)
    starts = random_starts(model, 2, seed=7)  # three random ones: make bench ONLY=tune
    found = fit(model, campaign, varies=session.freedom, starts=starts)
    assert found.agree == len(starts)
    gap = summarise(channel_gaps(predict(model, found.theta, campaign), campaign))
    # Some 30 000 values, and 357 coordinates that may follow their noise.
    assert gap.excess == pytest.approx(1.0, abs=0.03)
