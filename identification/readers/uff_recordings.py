"""Which time records of a universal file were recorded together.

No field of dataset 58 says. Where every force of a load case is followed by motions of distinct
channels (or all are followed by their force), those are its own; else, of the records with one
load case, response and reference, the first is of the first hit or recording, the second of the
second. The reference of a motion is the hammer's place; where it has none (node 0), the force's own
node and direction are.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from identification.words import Dof, InputError, Quantity, Real

_Key = tuple[int, Dof, int]  # load case, place of the hammer, number among its records


@dataclass(frozen=True, eq=False)
class Channel:
    """One time record.

    Args:
        number: in the file.
        case: load case.
        dof: where and along what.
        reference: of a motion, if it has one.
        quantity: of a motion; None for a force.
        start, rate: of the samples [s, Hz].
        values: in SI; (n_sample,).
    """

    number: int
    case: int
    dof: Dof
    reference: Dof | None
    quantity: Quantity | None
    start: float
    rate: float
    values: Real


def takes_of(path: Path, forces: list[Channel], motions: list[Channel]) -> list[list[Channel]]:
    """Sets of synchronous channels, the force first.

    Raises:
        InputError: channels without their force, a force without channels, contradicting
            references, unequal lengths, rates or starts.
    """
    takes, in_order = _of_forces(forces)
    own_force = _beside([*forces, *motions])
    keys = {take[0].number: key for key, take in takes.items()}
    for order, motion in _numbered(motions):
        reference = motion.reference
        if motion.number in own_force:
            key: _Key | None = keys[own_force[motion.number]]
        elif reference is None:
            key = in_order.get((motion.case, order))
        else:
            key = motion.case, reference.positive, order
        if key is None or key not in takes:
            raise InputError(
                f"{path}, record {motion.number} is number {order + 1} of {motion.dof} in load "
                f"case {motion.case}, and there is no such record of the force"
                + (f" at {reference}" if reference else "")
                + ": export forces and motions together"
            )
        force = takes[key][0]
        if reference is not None and reference != force.dof:
            raise InputError(
                f"{path}: the reference of record {motion.number} is {reference}, the direction of "
                f"its force in record {force.number} is {force.dof}: mend one of them"
            )
        takes[key].append(motion)
    for take in takes.values():
        if len(take) == 1:
            raise InputError(
                f"{path}, record {take[0].number} is a force without any motion: delete it"
            )
        refuse_unequal(path, take)
    return list(takes.values())


def _of_forces(
    forces: list[Channel],
) -> tuple[dict[_Key, list[Channel]], dict[tuple[int, int], _Key]]:
    """A take for each force, and its key by load case and order in it."""
    takes: dict[_Key, list[Channel]] = {}
    in_order: dict[tuple[int, int], _Key] = {}
    for order, force in _numbered(forces):
        key = force.case, force.dof.positive, order
        takes[key] = [force]
        before = sum(case == force.case for case, _ in in_order)
        in_order[force.case, before] = key
    return takes, in_order


def _beside(channels: list[Channel]) -> dict[int, int]:
    """Number of the force that each motion stands next to, in load cases where that is clear."""
    found: dict[int, int] = {}
    for case in {channel.case for channel in channels}:
        order = sorted((c for c in channels if c.case == case), key=lambda c: c.number)
        for rows in (order, order[::-1]):
            starts = [place for place, row in enumerate(rows) if row.quantity is None]
            ends = [*starts[1:], len(rows)]
            parts = [rows[start:end] for start, end in zip(starts, ends, strict=False)]
            names = [[row.dof.positive for row in part[1:]] for part in parts]
            if starts[:1] == [0] and all(own and len(set(own)) == len(own) for own in names):
                found |= {row.number: part[0].number for part in parts for row in part[1:]}
                break
    return found


def _numbered(channels: Iterable[Channel]) -> Iterator[tuple[int, Channel]]:
    """Each channel with the number of those of its kind before it in its load case."""
    seen: dict[tuple[int, Dof, Dof | None], int] = {}
    for channel in channels:
        reference = None if channel.reference is None else channel.reference.positive
        key = channel.case, channel.dof.positive, reference
        order = seen.get(key, 0)
        seen[key] = order + 1
        yield order, channel


def refuse_unequal(path: Path, take: list[Channel]) -> None:
    """Refuse channels of other length, rate or start than the first.

    Raises:
        InputError: with both records.
    """
    first = take[0]
    for channel in take[1:]:
        if len(channel.values) != len(first.values) or channel.rate != first.rate:
            raise InputError(
                f"{path}: records {first.number} and {channel.number} belong together and have "
                f"{len(first.values)} samples at {first.rate:g} Hz and {len(channel.values)} at "
                f"{channel.rate:g} Hz: export them with one length and rate"
            )
        if abs(channel.start - first.start) * first.rate > 0.5:
            raise InputError(
                f"{path}: records {first.number} and {channel.number} belong together and start at "
                f"{first.start:g} s and {channel.start:g} s: export them with one start"
            )
