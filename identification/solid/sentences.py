"""Sentences on the check of a body."""

from identification.solid.frequency_limit import (
    MAX_NONRIGID_SHARE,
    ResidualSpectrum,
    highest_solid_hz,
)
from identification.words import Real, percent_text

_MIN_STATED_PERCENT = 1e-3  # deviation from a solid body; less is rounding

FAULT_PHRASES = {
    "sensor_gain": "a wrong gain",
    "sensor_polarity": "a turned sign",
    "sensor_misalignment": "wrong axes",
    "sensor_position": "a wrong place",
    "sensor_swap": "exchanged channels",
    "sensor_delay": "a delay",
    "mount_resonance": "a resonance of its mount",
    "dead_channel": "no signal",
    "sensor_body": "a wrong body",
    "sensor_unknown": "a fault of no known kind",
}


def body_sentence(
    body: str,
    counts: tuple[int, int, int],
    freq_hz: Real,
    residuals: ResidualSpectrum,
    faults: list[str],
) -> str:
    """Return one sentence on the rigidity of a body and its faults.

    Args:
        body: its name.
        counts: number of channels, of motions that they determine, and of redundant channels.
        freq_hz: lines [Hz]; (n_freq,).
        residuals: residual along the lines.
        faults: faults of sensors and of the body, as phrases.
    """
    channels, rank, redundant = counts
    counts_text = (
        f"{body}: {channels} channels determine {rank} of 6 motions, "
        f"{redundant} {'is' if redundant == 1 else 'are'} redundant"
    )
    listed = "".join(f"; {fault}" for fault in faults)
    if redundant == 0:
        return f"{counts_text}: no check is possible{listed}."
    limit, band_end = highest_solid_hz(freq_hz, residuals.exceeds_bound), float(freq_hz[-1])
    largest = 100 * float(residuals.deviation[residuals.significant].max(initial=0.0))
    if limit is None:
        rigidity = (
            f"it never moves as a solid within {MAX_NONRIGID_SHARE:.0%}: {largest:.1f} % at most"
        )
    elif limit < band_end:
        rigidity = (
            f"it moves as a solid up to {limit:.4g} Hz and deviates by {largest:.1f} % above it"
        )
    elif largest > _MIN_STATED_PERCENT:
        rigidity = (
            f"it moves as a solid within {percent_text(largest / 100)} up to {limit:.4g} Hz, "
            "the end of the band"
        )
    else:
        rigidity = f"it moves as a solid up to {limit:.4g} Hz, the end of the band"
    if redundant == 1:
        rigidity += "; one redundant channel cannot locate a fault"
    return f"{counts_text}; {rigidity}{listed}."


def fault_phrase(effect: str, location: str, dof: str | None) -> str:
    """Return a fault in words: ``acc3 tx has a wrong gain``."""
    if effect == "flexible_body":
        return "the residual has a common shape: the body is flexible"
    if effect == "sensor_swap":
        return exchange_phrase(location, dof)
    place = location.split(":", 1)[1].replace("+", " and ")
    concerned = f" {dof.replace('+', ' and ')}" if dof else ""
    return f"{place}{concerned}: {FAULT_PHRASES[effect]}"


def exchange_phrase(location: str, dof: str | None) -> str:
    """Return exchanged sensors, or exchanged channels of one sensor, in words.

    Args:
        location: ``sensor:acc1``, or ``sensor:acc1+acc2`` for two sensors.
        dof: exchanged directions, such as ``tx+ty``; None for all of two sensors.
    """
    place = location.split(":", 1)[1].replace("+", " and ")
    if dof is None:
        return f"sensors {place} are exchanged"
    if "+" in dof:
        return f"channels {dof.replace('+', ' and ')} of {place} are exchanged"
    return f"channels {dof} of {place} are exchanged"


def confounded_phrase(first: str, second: str, redundant: int) -> str:
    """Return a phrase on two confounded hypotheses."""
    return f"{first} and {second} cannot be told apart with {redundant} redundant channels"
