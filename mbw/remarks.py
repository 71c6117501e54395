"""Remarks on a tuning that qualify its figures, for the terminal and for the page.

Gains that a campaign called unknown, as text and as a table.

Lines on a gap for the terminal, also where one of its numbers does not exist.
"""

import re
from collections.abc import Sequence
from html import escape

from identification.words import (
    TOLERANCE_BOUND_SIGMA,
    NominalGain,
    count_noun,
    group_by_key,
    percent_text,
)
from identification.words.ports import FLOOR
from mbmodel.mjcf.read import current_reading
from mbw.page.numbers import format_percent
from tuning import TunedFile
from tuning.files.result import TUNED_JSON
from tuning.files.schema import ChannelGainRow, FitRow
from tuning.fitting.machine_fit import PLAUSIBLE_PULL_SIGMA

# What instruments have and an MJCF has not: how a sentence calls it, parts of parameters' names
# that mark it, and the instrument.
_ELECTRIC = (
    ("gains", r"\.(gain|cross)_", "sensor"),
    ("delays", r"\.delay_", "sensor"),
    ("gain", r"\)\.gain", "force channel"),
    ("delay", r"\)\.delay", "force channel"),
)
_MAX_LISTED_NAMES = 4  # entries of a list that a sentence names; more would hide the sentence


def describe_search(fit: FitRow) -> str:
    """Return how a search ended, and how many of several starts agree."""
    text = f"{fit.outcome} after {fit.evaluations} evaluations"
    if fit.starts == 1:
        return text
    return f"{text}; {fit.agreeing_starts} of {fit.starts} starts within 2 % of the best cost"


def list_reading_options() -> list[str]:
    """Return the words of the command line by which another verb reads models as this one does."""
    reading = current_reading()
    words = ["--without", ",".join(reading.without)] if reading.without else []
    return [*words, "--soft-equalities"] if reading.soft_equalities else words


def list_remarks(summary: TunedFile) -> list[str]:
    """Return one sentence for each finding that limits the result, as the terminal shows them."""
    sentences = []
    if summary.fit.doubts:
        sentences.append(f"Doubts: {'; '.join(summary.fit.doubts)}.")
    if summary.unseen:
        sentences.append(f"{join_first([row.sentence for row in summary.unseen], '; ')}.")
    if at_bound := sum(row.at_bound and row.prior is not None for row in summary.parameters):
        sentences.append(at_bound_sentence(at_bound, _largest_pulls(summary)))
    if gains := gain_sentence(summary.channel_gains):
        sentences.append(gains)
    missing = describe_not_in_mjcf(summary.not_held_by_mjcf, summary.not_held_error, TUNED_JSON)
    if missing:
        sentences.append(missing)
    return sentences + list_limits(summary)


def list_limits(summary: TunedFile) -> list[str]:
    """Return one sentence for each finding that limits the error figures and the mode pairs."""
    sentences = list_notes(summary)
    if (
        summary.residuals[-1] != "modal"
        and summary.gap.sensors.held_out is None
        and not summary.interrupted
    ):
        sentences.append("The band is too narrow to hold frequency lines out.")
    unpaired = [f"{row.frequency:.4g}" for row in summary.pairs if row.tuned is None]
    if unpaired:
        sentences.append(f"Measured modes without a mode of the model: {', '.join(unpaired)} Hz.")
    if any(outcome != "converged" for outcome in summary.held_out_outcomes):
        sentences.append("Some held-out fits did not converge: the held-out error may be too high.")
    return sentences


def list_notes(summary: TunedFile) -> list[str]:
    """Return the limits that say what figures rest on; they do not make the result doubtful."""
    sentences = []
    if summary.residuals[-1] == "modal":
        sentences.append(
            "Modes were fitted last: they depend on all frequency lines, so that no line is held "
            "out."
        )
    if any(test.variance_from == "differences" for test in summary.tests):
        sentences.append(
            "The noise was estimated from third differences along frequency: the files hold no "
            "coherence of single inputs, or they state no number of averages above one."
        )
    return sentences


def at_bound_sentence(count: int, more: str = "") -> str:
    """Return a sentence on tolerances that a fit left at their bounds.

    Args:
        count: number of these tolerances.
        more: further clause.
    """
    return (
        f"{count_noun(count, 'tolerance')} reached the bound of {TOLERANCE_BOUND_SIGMA:g} standard "
        f"deviations{more}."
    )


def calibration_sentence(tolerance: float | None) -> str:
    """Return what absolute stiffness rests on: a wrong force scales it as it scales all masses.

    Args:
        tolerance: relative tolerance of the force channel's gain; 0 if it does not vary, None if
            no force has a known gain.
    """
    if tolerance is None:
        return (
            "Absolute stiffness and damping rest on the masses of the model, since no force has a "
            "known gain; the tolerances of masses are in the intervals."
        )
    text = "Absolute stiffness and damping rest on the calibration of the force channel"
    if not tolerance:
        return f"{text}, which the intervals take as exact."
    return f"{text}; its tolerance of {percent_text(tolerance)} is in the intervals."


def gain_tolerance(summary: TunedFile) -> float | None:
    """Return the largest tolerance of a known gain of a force that varied, 0 if none varied.

    None if all gains of forces are unknown, or the floor alone moves the machine.
    """
    gains = {
        row.name: row.prior or 0.0
        for row in summary.parameters
        if re.fullmatch(r"hammer\(.*\)\.gain", row.name)
    }
    drives = (row.location.partition(":")[2] for row in summary.channel_gains if row.dof is None)
    unknown = {f"hammer({name}).gain" for name in (*drives, FLOOR)}
    if gains and set(gains) <= unknown:
        return None
    return max((prior for name, prior in gains.items() if name not in unknown), default=0.0)


def describe_not_in_mjcf(names: Sequence[str], error: float | None, list_file: str) -> str:
    """Return a sentence on what a tuned MJCF cannot hold; sum up sensor gains and hammer hits.

    Args:
        names: parameters that the MJCF does not hold, each with its reason in brackets.
        error: relative change of the FRFs without them; None if it is not known.
        list_file: name of the file that lists all of them.

    Returns:
        The sentence; empty if the MJCF holds everything.
    """
    parts, rest = [], list(names)
    for what, pattern, thing in _ELECTRIC:
        things = {re.split(pattern, name)[0] for name in rest if re.search(pattern, name)}
        rest = [name for name in rest if not re.search(pattern, name)]
        parts += [f"{what} of {count_noun(len(things), thing)}"] if things else []
    hits = {name.split(")")[0] for name in rest if name.startswith("hammer(")}
    rest = [name for name in rest if not name.startswith("hammer(")]
    parts += [f"place and direction of {count_noun(len(hits), 'hit')}"] if hits else []
    parted = (name.partition(" (") for name in rest)
    by_reason = group_by_key((reason, parameter) for parameter, _, reason in parted)
    parts += [
        join_first(parameters) + (f" ({reason}" if reason else "")
        for reason, parameters in by_reason.items()
    ]
    if not parts:
        return ""
    size = "" if error is None else f"without them the FRFs change by {format_percent(error)}; "
    return f"The tuned MJCF does not hold: {', '.join(parts)} ({size}{list_file} lists them)."


def _largest_pulls(summary: TunedFile) -> str:
    """Return the largest pulls as a clause, unless the doubts say what implausible ones mean."""
    pulls = [(row.name, row.pull) for row in summary.parameters if row.pull is not None]
    pulls.sort(key=lambda row: -abs(row[1]))
    if not pulls or abs(pulls[0][1]) > PLAUSIBLE_PULL_SIGMA:
        return ""
    listed = ", ".join(f"{name} {pull:+.1f}" for name, pull in pulls[:_MAX_LISTED_NAMES])
    return f"; the largest pulls without the bound: {listed}"


def join_first(texts: list[str], separator: str = ", ") -> str:
    """Join the first texts, and state how many more there are."""
    omitted = len(texts) - _MAX_LISTED_NAMES
    more = f" and {omitted} more" if omitted > 0 else ""
    return separator.join(texts[:_MAX_LISTED_NAMES]) + more


_MIN_SHOWN_DELAY_S = 1e-5  # half of the default tolerance
_MAX_LISTED_GAINS = 12  # in a sentence of the terminal; pages and files list all


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


NO_QUIET_CHANNEL = "the noise of every channel exceeds 30 % of its motion"


def describe_gap(error: float | None, excess: float | None) -> str:
    """Return error and excess as text; a number that does not exist is explained.

    Args:
        error: relative error over channels with little noise; None if there is no such channel.
        excess: error over noise, over all channels; None if no channel has a known noise.
    """
    if error is None and excess is None:
        return "unknown, because no channel has a known noise"
    shown = f"excess {number_text(excess)}"
    if error is None:
        return f"{shown}; {NO_QUIET_CHANNEL}, so no relative error is stated"
    return f"error {number_text(error)}, {shown}"


def number_text(value: float | None) -> str:
    """Return a number with three digits, or ``unknown``."""
    return "unknown" if value is None else f"{value:.3g}"
