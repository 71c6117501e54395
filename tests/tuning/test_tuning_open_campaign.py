"""The open campaign without an effect: as near to the noise as stiffness and damping can come."""

from pathlib import Path

import pytest

from tuning import channel_gaps, fit, open_session, predict, random_starts, summarise

NONE = Path(__file__).resolve().parents[3] / "shared" / "campaigns" / "open" / "none"


@pytest.mark.skipif(not NONE.exists(), reason="the shared campaigns are not beside the clone")
def test_every_start_comes_within_three_times_the_noise():
    session = open_session(NONE)
    model, campaign = session.model, session.campaign
    starts = random_starts(model, 2, seed=7)  # three random ones: make bench ONLY=tune
    found = fit(model, campaign, starts=starts)
    assert found.agree == len(starts)
    gap = summarise(channel_gaps(predict(model, found.theta, campaign), campaign))
    assert gap.error <= 3.0 * gap.noise
