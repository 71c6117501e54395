"""Groups of time records of a universal file that were recorded together.

No field of dataset 58 identifies a recording. If in a load case every force is followed by motions
of distinct channels, or preceded by them, those motions belong to this force. Otherwise records
are matched by order: of the records with one load case, response and reference, the first belongs
to the first recording, the second to the second. The reference of a motion is the hammer point. If
a motion has none (node 0), node and direction of the force apply.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from identification.words import Dof, InputError, Quantity, Real, group_by_key

_RecordingKey = tuple[int, Dof, int]  # load case, hammer point, order among its records
_MAX_START_DIFFERENCE = 0.5  # samples: by which the starts of synchronous records may differ


@dataclass(frozen=True, eq=False)
class Channel:
    """Time record of one channel.

    Args:
        number: number of the record in the file.
        case: load case.
        dof: degree of freedom of the force or motion.
        reference: reference of a motion, or None.
        quantity: quantity of the FRFs that a motion gives; None for a force.
        start: time of the first sample [s].
        rate: sampling rate [Hz].
        values: samples in SI units; (n_sample,).
    """

    number: int
    case: int
    dof: Dof
    reference: Dof | None
    quantity: Quantity | None
    start: float
    rate: float
    values: Real


def find_recordings_at_once(
    forces: list[Channel], motions: list[Channel]
) -> dict[tuple[int, int], list[Channel]]:
    """Return the recordings in which several forces acted at once, by load case and repetition.

    Every force and every motion of such a load case is there as often, and motions have no
    reference that would tell their force: of forces one after the other, motions are more.
    """
    channels = [*forces, *motions]
    repetitions = {id(channel): order for order, channel in _count_repetitions(channels)}
    recordings: dict[tuple[int, int], list[Channel]] = {}
    for case in dict.fromkeys(force.case for force in forces):
        here = [channel for channel in channels if channel.case == case]
        counts = Counter((c.quantity is None, c.dof.positive) for c in here)
        several = sum(is_force for is_force, _ in counts) > 1
        has_reference = any(channel.reference is not None for channel in here)
        if several and not has_reference and len(set(counts.values())) == 1 < len(counts):
            recordings |= group_by_key(((case, repetitions[id(each)]), each) for each in here)
    return recordings


def group_recordings(
    path: Path, forces: list[Channel], motions: list[Channel]
) -> list[list[Channel]]:
    """Group the channels into synchronous recordings, each with its force first.

    Raises:
        InputError: a motion has no force, a force has no motion, references contradict the force,
            or lengths, rates or starts differ within a recording.
    """
    recordings, in_order = _begin_recordings(forces)
    adjacent = _adjacent_forces([*forces, *motions])
    keys = {recording[0].number: key for key, recording in recordings.items()}
    for order, motion in _count_repetitions(motions):
        reference = motion.reference
        if motion.number in adjacent:
            key: _RecordingKey | None = keys[adjacent[motion.number]]
        elif reference is None:
            key = in_order.get((motion.case, order))
        else:
            key = motion.case, reference.positive, order
        if key is None or key not in recordings:
            raise InputError(
                f"{path}, record {motion.number} is motion {order + 1} of {motion.dof} in load "
                f"case {motion.case}, but the force has no such record"
                + (f" at {reference}" if reference else "")
                + ": export forces and motions together"
            )
        force = recordings[key][0]
        if reference is not None and reference != force.dof:
            raise InputError(
                f"{path}: the reference of record {motion.number} is {reference}, but its force in "
                f"record {force.number} acts at {force.dof}: correct one of them"
            )
        recordings[key].append(motion)
    for recording in recordings.values():
        if len(recording) == 1:
            raise InputError(
                f"{path}, record {recording[0].number} is a force without any motion: delete it"
            )
        refuse_unequal(path, recording)
    return list(recordings.values())


def _begin_recordings(
    forces: list[Channel],
) -> tuple[dict[_RecordingKey, list[Channel]], dict[tuple[int, int], _RecordingKey]]:
    """Begin a recording for each force; return them, and their keys by load case and order."""
    recordings: dict[_RecordingKey, list[Channel]] = {}
    in_order: dict[tuple[int, int], _RecordingKey] = {}
    for order, force in _count_repetitions(forces):
        key = force.case, force.dof.positive, order
        recordings[key] = [force]
        earlier = sum(case == force.case for case, _ in in_order)
        in_order[force.case, earlier] = key
    return recordings, in_order


def _adjacent_forces(channels: list[Channel]) -> dict[int, int]:
    """Return the record of the force that precedes or follows the records of motions.

    Load cases in which that is ambiguous are left out.
    """
    adjacent: dict[int, int] = {}
    for case in {channel.case for channel in channels}:
        order = sorted((c for c in channels if c.case == case), key=lambda c: c.number)
        for rows in (order, order[::-1]):
            starts = [place for place, row in enumerate(rows) if row.quantity is None]
            ends = [*starts[1:], len(rows)]
            parts = [rows[start:end] for start, end in zip(starts, ends, strict=False)]
            names = [[row.dof.positive for row in part[1:]] for part in parts]
            if starts[:1] == [0] and all(dofs and len(set(dofs)) == len(dofs) for dofs in names):
                adjacent |= {row.number: part[0].number for part in parts for row in part[1:]}
                break
    return adjacent


def _count_repetitions(channels: Iterable[Channel]) -> Iterator[tuple[int, Channel]]:
    """Yield each channel with the number of earlier ones of its load case, DOF and reference."""
    counts: dict[tuple[int, Dof, Dof | None], int] = {}
    for channel in channels:
        reference = None if channel.reference is None else channel.reference.positive
        key = channel.case, channel.dof.positive, reference
        order = counts.get(key, 0)
        counts[key] = order + 1
        yield order, channel


def refuse_unequal(path: Path, recording: list[Channel]) -> None:
    """Refuse channels whose length, rate or start differs from that of the first.

    Raises:
        InputError: two records differ; the message names both.
    """
    first = recording[0]
    for channel in recording[1:]:
        if len(channel.values) != len(first.values) or channel.rate != first.rate:
            raise InputError(
                f"{path}: records {first.number} and {channel.number} belong together but have "
                f"{len(first.values)} samples at {first.rate:g} Hz and {len(channel.values)} at "
                f"{channel.rate:g} Hz: export them with one length and rate"
            )
        if abs(channel.start - first.start) * first.rate > _MAX_START_DIFFERENCE:
            raise InputError(
                f"{path}: records {first.number} and {channel.number} belong together but start at "
                f"{first.start:g} s and {channel.start:g} s: export them with one start"
            )
