"""The open campaign without an effect: tolerances alone are off, so that noise alone remains."""

from dataclasses import replace
from pathlib import Path

import pytest

from tuning import channel_gaps, fit, open_session, predict, random_starts, summarise_gaps

NONE = Path(__file__).resolve().parents[3] / "shared" / "campaigns" / "open" / "none"


@pytest.mark.skipif(not NONE.exists(), reason="the shared campaigns are not beside the clone")
def test_every_start_reaches_the_noise():
    session = open_session(NONE)
    model, campaign = session.model, session.campaign.select_lines(slice(2, None, 5))
    session = replace(session, campaign=campaign)
    starts = random_starts(model, 2, seed=7)  # three random ones: make bench ONLY=tune
    result = fit(model, campaign, parametrisation=session.parametrisation, starts=starts)
    assert result.agreeing_starts == len(starts)
    gap = summarise_gaps(channel_gaps(predict(model, result.theta, campaign), campaign))
    # Some 30 000 values, and 357 coordinates that may follow their noise.
    assert gap.excess == pytest.approx(1.0, abs=0.03)
