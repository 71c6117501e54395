"""Frequency band in which the FRFs of a campaign are used."""

from pathlib import Path

import numpy as np

from identification.words import Campaign, InputError, Mask

_MIN_BAND_COHERENCE = 0.5  # median over channels at the first and the last line of the band


def band_lines(
    campaign: Campaign, band: tuple[float, float] | None = None, source: Path | None = None
) -> Mask:
    """Choose the frequency lines of a band.

    By default the band reaches from the first to the last line whose median coherence over
    channels exceeds 0.5; without coherence it has all lines except 0 Hz. If tests come from time
    records, it ends at 0.8 of half the sampling rate, since anti-aliasing filters distort the
    response above.

    Args:
        campaign: campaign whose lines are chosen.
        band: lowest and highest frequency [Hz], both included; None for the default.
        source: path of the campaign, for messages.

    Returns:
        Mask of the chosen lines; (n_freq,).

    Raises:
        InputError: the band holds no line.
    """
    freq = campaign.freq_hz
    name = source or campaign.name
    if band is not None:
        lines = (freq >= band[0]) & (freq <= band[1])
        if not lines.any():
            raise InputError(
                f"{name}: the band {band[0]:g}..{band[1]:g} Hz holds none of the lines "
                f"{freq[0]:g}..{freq[-1]:g} Hz: widen it"
            )
        return lines
    highest = [test.hits.usable_limit_hz for test in campaign.tests if test.hits is not None]
    below = freq < min(highest, default=np.inf)
    coherences = [test.estimate.coherence for test in campaign.tests]
    known = [c.reshape(len(freq), -1) for c in coherences if c is not None]
    if len(known) < len(coherences):
        lines = (freq > 0) & below
        if not lines.any():
            raise InputError(f"{name}: there is no line above 0 Hz: export the FRFs again")
        return lines
    good = np.flatnonzero((np.median(np.hstack(known), axis=1) > _MIN_BAND_COHERENCE) & below)
    if not good.size:
        raise InputError(
            f"{name}: the median coherence exceeds {_MIN_BAND_COHERENCE} at no line: check the "
            "test, or give a band"
        )
    lines = np.zeros(len(freq), bool)
    lines[good[0] : good[-1] + 1] = True
    return lines
