"""Kind of excitation: hits of a hammer, or the force of a shaker or motor that never rests."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.hits.detection import Blow, find_blows
from identification.words import InputError, Records

# Net over absolute impulse of all pulses: a hammer pushes and never pulls, so that its hits have 1.
# With lobes of 60 % of their predecessor, the worst ringing of a hammer that is read, they have
# (1 - 0.6) / (1 + 0.6) = 0.25. N lobes of random sign have sqrt(2 / (pi N)): 0.15 for 30 of them.
_MIN_NET_IMPULSE = 0.2


def is_continuous(records: Records, blows: Sequence[Blow]) -> bool:
    """Return whether a force is no series of hits: it never rests, or pulls as much as it pushes.

    Args:
        records: records of one reference.
        blows: hits that were found in them.

    Raises:
        InputError: the force is zero.
    """
    if not np.ptp(records.force, axis=1).any():
        raise InputError(
            f"{records.test}: there is no hit in the force along {records.reference}: check which "
            "channel is the force"
        )
    return not blows or _net_impulse(records, blows) < _MIN_NET_IMPULSE


def refuse_exchanged_force(records: Records) -> None:
    """Refuse records in which a motion is a series of hits and the force is not.

    Args:
        records: of a force that never rests.

    Raises:
        InputError: a motion looks like the force of a hammer.
    """
    for row, output in enumerate(records.outputs):
        motion = records.motion[:, row]
        exchanged = replace(records, force=motion)
        if np.ptp(motion, axis=1).any() and not is_continuous(exchanged, find_blows(exchanged)):
            raise InputError(
                f"{records.test}: the force along {records.reference} never rests, but {output} is "
                "a series of hits: check which channel is the force"
            )


def _net_impulse(records: Records, blows: Sequence[Blow]) -> float:
    """Return the net impulse of all pulses of each record over their absolute impulse."""
    net, total = np.zeros(len(records.force)), 0.0
    levels = records.force - np.median(records.force, axis=1, keepdims=True)
    for blow in blows:
        for pulse in (blow.main, *blow.bounces):
            impulse = float(levels[pulse.record, pulse.onset : pulse.end].sum())
            net[pulse.record] += impulse
            total += abs(impulse)
    return float(np.abs(net).sum() / total) if total else 1.0
