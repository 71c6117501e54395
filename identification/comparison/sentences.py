"""Sentences on the comparison of tests."""

from collections.abc import Sequence

import numpy as np

from identification.comparison.compared_modes import ComparedMode, FleetScatter, Shift
from identification.words import capitalise, percent_text, shorten_names


def describe_shifts(
    modes: Sequence[ComparedMode],
    shifts: Sequence[tuple[Shift, Shift] | None],
    names: Sequence[str],
    *,
    is_one_machine: bool,
) -> str:
    """Return which modes differ between two tests, and which have no partner.

    Args:
        modes: modes of both tests.
        shifts: shift of frequency and damping of each mode; None for an unpaired one.
        names: names of both tests.
        is_one_machine: whether the drift between two visits was allowed.
    """
    pairs = [(m, s) for m, s in zip(modes, shifts, strict=True) if s is not None]
    changed = [(m, s) for m, s in pairs if s[0].is_change or s[1].is_change]
    beyond = "noise and the drift between visits" if is_one_machine else "noise"
    verb = "changed" if is_one_machine else "differ"
    if not pairs:
        text = "no mode of one test was found in the other"
    elif not changed:
        text = f"none of {len(pairs)} modes {verb} beyond {beyond}"
    else:
        mode, (frequency, _) = max(changed, key=lambda pair: _relative_size(pair[1]))
        first = float(mode.freq_hz[0])
        shift = f"by {100 * frequency.value / first:+.2g} % in frequency"
        if not frequency.is_change:
            shift = f"from {mode.damping[0]:.2%} to {mode.damping[1]:.2%} in damping"
        text = (
            f"{len(changed)} of {len(pairs)} modes {verb} beyond {beyond}, most the mode at "
            f"{first:.4g} Hz, {shift}"
        )
    partnerless = [
        f"{name} alone has {shorten_names([f'{mode.freq_hz[k]:.4g}' for mode in alone])} Hz"
        for k, name in enumerate(names)
        if (alone := [m for m in modes if m.number[k] >= 0 and not m.is_complete])
    ]
    if len(partnerless) == len(names):
        partnerless[-1] += ", perhaps modes that moved too far to be paired"
    return "; ".join([capitalise(text), *partnerless]) + "."


def _relative_size(shifts: tuple[Shift, Shift]) -> float:
    """Return the change of a mode in standard deviations of noise and drift."""
    return max(
        abs(shift.value) / max(float(np.hypot(shift.deviation, shift.drift)), 1e-300)
        for shift in shifts
        if shift.is_change
    )


def describe_fleet(
    modes: Sequence[ComparedMode], scatter: FleetScatter, names: Sequence[str]
) -> str:
    """Return where the machines of a fleet scatter most, and which of them stand out.

    Args:
        modes: modes of all machines.
        scatter: scatter of their frequencies, perhaps with machines that stand out by damping too.
        names: names of the machines.
    """
    shared = [k for k, mode in enumerate(modes) if mode.is_complete]
    texts = [f"{len(shared)} of {len(modes)} modes were found in all {len(names)} tests"]
    spread = scatter.spread / np.where(scatter.mean > 0, scatter.mean, 1.0)
    if shared:
        most = max(shared, key=lambda k: spread[k])
        noise = scatter.within[most] / scatter.mean[most]
        texts.append(
            f"the tests scatter most at {scatter.mean[most]:.4g} Hz, by "
            f"{percent_text(float(spread[most]))} against {percent_text(float(noise))} within a "
            "test"
        )
    for place, name in enumerate(names):
        rows = np.flatnonzero(scatter.stands_out[:, place])
        if len(rows):
            listed = shorten_names([f"{scatter.mean[k]:.4g}" for k in rows])
            texts.append(f"{name} stands out at {listed} Hz")
    if not scatter.stands_out.any():
        texts.append("no test stands out from the others")
    return "; ".join(texts) + "."
