"""Kind of excitation: hits of a hammer, or the force of a shaker or motor that never rests."""

from collections.abc import Sequence

import numpy as np

from identification.hits.detection import Blow
from identification.words import InputError, Records

# Net over absolute impulse of all pulses: a hammer pushes and never pulls, so that its hits have 1.
# With lobes of 60 % of their predecessor, the worst ringing of a hammer that is read, they have
# (1 - 0.6) / (1 + 0.6) = 0.25. N lobes of random sign have sqrt(2 / (pi N)): 0.15 for 30 of them.
_MIN_NET_IMPULSE = 0.2


def refuse_continuous(records: Records, blows: Sequence[Blow]) -> None:
    """Refuse records whose force is no series of hits.

    Args:
        records: records of one reference.
        blows: hits that were found in them.

    Raises:
        InputError: the force is zero, never rests, or pulls as much as it pushes.
    """
    where = f"the force along {records.reference}"
    advice = "give its FRFs, or check which channel is the force"
    if not blows:
        if not np.ptp(records.force, axis=1).any():
            raise InputError(
                f"{records.test}: there is no hit in {where}: check which channel is the force"
            )
        raise InputError(
            f"{records.test}: {where} never rests and has no hit, which is continuous excitation "
            f"(random, sine or sweep): {advice}"
        )
    if _net_impulse(records, blows) < _MIN_NET_IMPULSE:
        raise InputError(
            f"{records.test}: {where} pulls as much as it pushes, which is no hammer but bursts of "
            f"continuous excitation (burst random, chirp or sweep): {advice}"
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
