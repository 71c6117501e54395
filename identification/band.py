"""The band of frequencies that a campaign can be trusted in."""

from pathlib import Path

import numpy as np

from identification.words import Campaign, InputError, Mask

_GOOD = 0.5


def band_lines(
    campaign: Campaign, band: tuple[float, float] | None = None, source: Path | None = None
) -> Mask:
    """Choose the lines of a band.

    Without a band given: from the first to the last line whose median coherence over channels
    exceeds 0.5; without coherence all lines but 0 Hz. Of tests that come from time records, in
    both cases, below 0.8 of half the rate: above it anti-aliasing filters reach.

    Args:
        campaign: whose lines.
        band: lowest and highest frequency [Hz], both included.
        source: of the campaign, for messages.

    Returns:
        Mask; (n_freq,).

    Raises:
        InputError: no line is left.
    """
    freq = campaign.freq_hz
    where = source or campaign.name
    if band is not None:
        lines = (freq >= band[0]) & (freq <= band[1])
        if not lines.any():
            raise InputError(
                f"{where}: the band {band[0]:g}..{band[1]:g} Hz holds none of the lines "
                f"{freq[0]:g}..{freq[-1]:g} Hz: widen it"
            )
        return lines
    highest = [test.hits.highest_hz for test in campaign.tests if test.hits is not None]
    below = freq < min(highest, default=np.inf)
    coherences = [test.estimate.coherence for test in campaign.tests]
    known = [c.reshape(len(freq), -1) for c in coherences if c is not None]
    if len(known) < len(coherences):
        lines = (freq > 0) & below
        if not lines.any():
            raise InputError(f"{where}: there is no line but 0 Hz: export the FRFs again")
        return lines
    good = np.flatnonzero((np.median(np.hstack(known), axis=1) > _GOOD) & below)
    if not good.size:
        raise InputError(
            f"{where}: at no line does the median coherence exceed {_GOOD}: check the test, or "
            "give a band"
        )
    lines = np.zeros(len(freq), bool)
    lines[good[0] : good[-1] + 1] = True
    return lines
