"""Gains that a campaign called unknown, as text and as a table."""

from collections.abc import Sequence
from html import escape

from identification.words import Campaign, NominalGain
from tuning.files.schema import ChannelGainRow

_MIN_SHOWN_DELAY_S = 1e-5  # half of the default tolerance
_MAX_LISTED_GAINS = 12  # in a sentence of the terminal; pages and files list all


def unknown_gain_sentences(campaign: Campaign) -> list[str]:
    """Return what unknown gains mean for a modal model, which is identified without them."""
    unknown, sentences = campaign.unknown_gains, list[str]()
    how = (
        "are divided by an estimate from the nominal model"
        if unknown.nominal
        else "stand as they were read"
    )
    if unknown.sensors:
        sentences.append(
            f"the gain of {', '.join(sorted(unknown.sensors))} is unknown: its FRFs {how}, and the "
            "check of solid bodies leaves it out; mbw tune finds the gain"
        )
    if unknown.hammers:
        sentences.append(
            f"the gain of the force channel {', '.join(sorted(unknown.hammers))} is unknown: its "
            f"FRFs {how}, so that the scale of mode shapes is not measured, and no drive point is "
            "checked; mbw tune finds the gain"
        )
    return sentences


def gain_sentence(rows: Sequence[ChannelGainRow]) -> str:
    """Return a sentence on the gains that were found; empty without any."""
    if not rows:
        return ""
    listed = ", ".join(f"{_label(row)} {_value(row)}" for row in rows[:_MAX_LISTED_GAINS])
    more = len(rows) - _MAX_LISTED_GAINS
    more_text = f" and {more} more" if more > 0 else ""
    return f"Unknown gains, measured value per SI unit: {listed}{more_text}."


def gain_table(rows: Sequence[ChannelGainRow]) -> str:
    """Return a section of a page with all gains; empty without any."""
    if not rows:
        return ""
    body = "".join(
        f'<tr><td class="name">{escape(_label(row))}</td><td>{row.gain:.4g}</td>'
        f"<td>{_end(row, 0)}</td><td>{_end(row, 1)}</td><td>{_delay(row)}</td></tr>"
        for row in rows
    )
    return (
        '<h2>Unknown gains</h2><p class="soft">Measured value per SI unit, '
        "<em>H</em><sub>measured</sub> = gain <em>H</em>. The FRFs of this page are divided by "
        "the gains that were estimated before the fit.</p>"
        '<table><thead><tr><th class="name">channel</th><th>gain</th>'
        f'<th colspan="2">95 % interval</th><th></th></tr></thead><tbody>{body}</tbody></table>'
    )


def _label(row: ChannelGainRow) -> str:
    """Return the place of a gain in words."""
    name = NominalGain(row.location, row.dof, row.gain).label
    return f"{name} (times the force channel's)" if row.is_product else name


def _value(row: ChannelGainRow) -> str:
    """Return a gain with its interval, and the delay of a drive."""
    late = f", {_delay(row)}" if _delay(row) else ""
    if row.interval is None:
        return f"{row.gain:.4g}{late}"
    return f"{row.gain:.4g} ({row.interval[0]:.4g} to {row.interval[1]:.4g}){late}"


def _delay(row: ChannelGainRow) -> str:
    """Return how late a drive is; empty for a channel, or without a delay worth stating."""
    if row.delay is None or abs(row.delay) < _MIN_SHOWN_DELAY_S:
        return ""
    return f"{'late' if row.delay > 0 else 'early'} by {1e3 * abs(row.delay):.3g} ms"


def _end(row: ChannelGainRow, end: int) -> str:
    """Return one end of the interval, or a dash."""
    return "-" if row.interval is None else f"{row.interval[end]:.4g}"
