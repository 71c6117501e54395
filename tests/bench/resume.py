"""Tunings killed at random moments and resumed: the same bits as one that ran through?"""

import tempfile
from pathlib import Path

import numpy as np
from rich.progress import track

from tests.helpers.killed import campaign_in, killed_and_resumed, whole

TRIALS, SEED = 20, 65_000


def run() -> list[dict[str, object]]:
    """20 kills, spread evenly over the time that a whole run takes."""
    random = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as name:
        campaign = campaign_in(Path(name), SEED)
        bits, seconds = whole(campaign, Path(name) / "whole")
        found = [
            killed_and_resumed(campaign, Path(name) / f"killed{trial}", moment * seconds)
            for trial, moment in enumerate(
                track(random.uniform(0.1, 1.0, TRIALS), description="kills")
            )
        ]
    return [
        {
            "killed": TRIALS,
            "before the end": sum(one.killed for one in found),
            "with finished steps": sum(one.steps > 0 for one in found),
            "the same bits": sum(one.bits == bits for one in found),
        }
    ]
