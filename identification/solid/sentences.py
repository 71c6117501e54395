"""The verdict on a body, in words."""

from identification.solid.frequency_limit import SOLID_WITHIN, Spectrum, solid_to
from identification.words import Real

FAULTS = {
    "sensor_gain": "a wrong gain",
    "sensor_polarity": "a turned sign",
    "sensor_misalignment": "wrong axes",
    "sensor_position": "a wrong place",
    "sensor_swap": "exchanged channels",
    "sensor_delay": "a delay",
    "mount_resonance": "a resonance of its mount",
    "dead_channel": "no signal",
    "sensor_unknown": "a fault of no known kind",
}


def verdict(
    body: str, counts: tuple[int, int, int], freq_hz: Real, seen: Spectrum, faults: list[str]
) -> str:
    """One sentence on solidity.

    Args:
        body: its name.
        counts: channels, motions that they determine, spare channels.
        freq_hz: lines; (n_freq,).
        seen: what remains along them.
        faults: of sensors and of the body, as phrases.
    """
    channels, rank, spare = counts
    has = f"{body}: {channels} channels determine {rank} of 6 motions and leave {spare} spare"
    if spare == 0:
        return f"{has}: no check is possible."
    to, top = solid_to(freq_hz, seen.beyond), float(freq_hz[-1])
    most = 100 * float(seen.deviation[seen.significant].max(initial=0.0))
    if to is None:
        said = f"it never moves as a solid within {SOLID_WITHIN:.0%}: {most:.1f} % at most"
    elif to < top:
        said = f"it moves as a solid up to {to:.4g} Hz and deviates by {most:.1f} % above it"
    elif most > 0:
        said = f"it moves as a solid within {most:.2g} % up to {to:.4g} Hz, the end of the band"
    else:
        said = f"it moves as a solid up to {to:.4g} Hz, the end of the band"
    if spare == 1:
        said += "; no fault can be placed with one spare channel"
    return f"{has}; {said}{''.join('; ' + fault for fault in faults)}."


def phrase(effect: str, location: str, dof: str | None) -> str:
    """A fault in words: ``acc3 tx has a wrong gain``."""
    if effect == "flexible_body":
        return "what remains has a common shape: the body is flexible"
    place = location.split(":", 1)[1].replace("+", " and ")
    concerned = f" {dof.replace('+', ' and ')}" if dof else ""
    return f"{place}{concerned}: {FAULTS[effect]}"


def alike(first: str, second: str, spare: int) -> str:
    """Two hypotheses that look alike."""
    return f"{first} and {second} look alike with {spare} spare channels"
