"""What a reader of a modal model must know first, in words."""

import numpy as np

from identification.modal import UNIT_MASS
from mbw.identify.result import Result
from mbw.identify.schema import ModeRow

_ALIKE, _LOOSE, _RECIPROCAL, _GOOD, _VAGUE = 0.9, 1.5, 0.95, 0.8, 0.15


def lead(result: Result) -> str:
    """What was found, how well it answers, and how it compares with the model, in sentences."""
    summary = result.summary
    if not summary.modes:
        return f"No mode was found in {summary.band[0]:g}..{summary.band[1]:g} Hz."
    freq = [row.frequency for row in summary.modes]
    damping = [100 * row.damping for row in summary.modes]
    text = (
        f"{len(freq)} modes from {min(freq):.1f} to {max(freq):.1f} Hz, with damping ratios of "
        f"{min(damping):.2g} to {max(damping):.2g} %."
    )
    if summary.error is not None and summary.noise is not None:
        text += (
            f" FRFs synthesised from them differ from the measured ones by "
            f"{_percent(summary.error)}; the noise alone makes {_percent(summary.noise)}."
        )
    if summary.compared_with and summary.modes:
        good = [row for row in summary.modes if (row.other_mac or 0) >= _GOOD]
        text += (
            f" {len(good)} of them resemble a mode of {summary.compared_with} (MAC of "
            f"{_GOOD:g} or more)"
        )
        if good:
            worst = max(good, key=lambda row: abs(_shift(row.frequency, row.other)))
            text += (
                f", whose frequencies are up to {abs(_shift(worst.frequency, worst.other)):.2g} % "
                "off"
            )
        text += "."
    return text


def _shift(measured: float, other: float | None) -> float:
    return 100 * ((other or measured) / measured - 1)


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def remarks(result: Result) -> list[str]:
    """One sentence for each thing that limits what the modal model says."""
    summary = result.summary
    found = [text.rstrip(".") + "." for text in summary.remarks]
    if summary.roved:
        found.append(
            "The hammer roved: by reciprocity, the points that were hit stand here as outputs, the "
            "sensors as inputs."
        )
    if summary.misfit > _LOOSE:
        found.append(
            f"What the modes do not explain is {summary.misfit:.3g} times the variance of the "
            "noise: look at the synthesis error for the channels, at the diagram for a mode that "
            "is missing."
        )
    if summary.normalisation != UNIT_MASS:
        found.append(
            "No input is measured as an output too: without a drive point shapes have no scale, "
            "and only the measured columns of the FRF matrix can be synthesised."
        )
    vague = [row for row in summary.modes if row.damping_sd > _VAGUE * row.damping]
    if vague:
        found.append(
            f"The damping of {_modes(result, vague)} is uncertain by more than "
            f"{100 * _VAGUE:.0f} %: a mode that the test hardly moves, or none."
        )
    low = [row for row in summary.modes if (row.reciprocity or 1.0) < _RECIPROCAL]
    if low:
        found.append(
            f"At the drive points, forces and motions are not reciprocal in {_modes(result, low)}: "
            "check directions and places of hammer and sensor before trusting that scale."
        )
    for one, other in _lookalikes(result):
        found.append(
            f"Modes {one + 1} and {other + 1} have like shapes (MAC "
            f"{result.arrays['auto_mac'][one, other]:.2f}) and like frequencies: the sensors may "
            "be too few to tell them apart, or one mode was found twice."
        )
    if summary.undetermined_bodies:
        found.append(
            "Not all six directions follow from the sensors on "
            f"{', '.join(summary.undetermined_bodies)}: drawn at rest, the sensors alone move."
        )
    turned = [
        label
        for label, value, known in zip(
            summary.outputs, result.arrays["comac_solid"], result.arrays["is_solid"], strict=True
        )
        if known and value < 0
    ]
    if turned:
        found.append(f"Against the motion of its body goes {', '.join(turned)}: a turned channel?")
    return found


def _modes(result: Result, rows: list[ModeRow]) -> str:
    numbers = [str(result.summary.modes.index(row) + 1) for row in rows]
    return ("mode " if len(numbers) == 1 else "modes ") + ", ".join(numbers)


def _lookalikes(result: Result) -> list[tuple[int, int]]:
    """Neighbours with like shapes whose frequencies are within five per cent."""
    count = len(result.summary.modes)
    freq = np.array([row.frequency for row in result.summary.modes])
    alike = np.triu(result.arrays["auto_mac"][:count, :count] > _ALIKE, 1)
    alike &= np.abs(freq[:, None] / freq - 1) < 0.05
    return [(int(one), int(other)) for one, other in np.argwhere(alike)]
