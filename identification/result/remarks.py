"""Summary of a modal model in sentences, and remarks on its limits."""

import numpy as np

from identification.modal import UNIT_MASS, missing_drive_point_sentence
from identification.result.schema import IdentifiedModeRow, IdentifiedModesFile
from identification.result.stored_result import IdentificationResult
from identification.solid import exchange_phrase
from identification.words import capitalise, percent_text

_MIN_LOOKALIKE_MAC = 0.9  # of two measured shapes that the sensors may not distinguish
_MAX_LOOKALIKE_SHIFT = 0.05  # relative difference of their frequencies
_MAX_MISFIT = 1.5  # squared error over the variance of the noise; beyond, a mode may be missing
_MIN_RECIPROCITY = 0.95  # MAC of shape and participation at the drive points
_MIN_MATCHING_MAC = 0.8  # of a measured and a reference shape that count as one mode
# Half-power bandwidth over the line spacing: a Hann window gives an undamped mode 1 to 1.5.
_MAX_LEAKY_LINES = 1.6
_MAX_SCALE_SD = 0.1  # relative standard deviation of the size of a shape
_MAX_DAMPING_SD = 0.15  # standard deviation of a damping ratio over the ratio


def lead(result: IdentificationResult) -> str:
    """Return sentences on the modes, on their synthesis error and on the reference modes."""
    summary = result.summary
    if not summary.modes:
        return _no_modes_sentence(summary)
    freq = [row.frequency for row in summary.modes]
    damping = [100 * row.damping for row in summary.modes]
    text = (
        f"{len(freq)} modes from {min(freq):.1f} to {max(freq):.1f} Hz, with damping ratios of "
        f"{min(damping):.2g} to {max(damping):.2g} %."
    )
    if summary.error is not None and summary.noise is not None:
        text += (
            f" FRFs synthesised from them differ from the measured ones by "
            f"{_percent(summary.error)}; the noise alone would cause {_percent(summary.noise)}."
        )
    if summary.compared_with and summary.modes:
        matching = [row for row in summary.modes if (row.other_mac or 0) >= _MIN_MATCHING_MAC]
        text += (
            f" {len(matching)} of them resemble a mode of {_reference_name(summary.compared_with)} "
            f"(MAC of {_MIN_MATCHING_MAC:g} or more)"
        )
        if matching:
            worst = max(matching, key=lambda row: abs(_shift(row.frequency, row.other)))
            text += (
                f"; its frequency differs by up to "
                f"{abs(_shift(worst.frequency, worst.other)):.2g} %"
            )
        text += "."
    return text


def _no_modes_sentence(summary: IdentifiedModesFile) -> str:
    """Say that no mode was found, and what to do."""
    return (
        f"No mode was identified in {summary.band[0]:g}..{summary.band[1]:g} Hz: look for peaks of "
        "the CMIF on the page, widen --band or move it to them, add a mode by --add, or allow more "
        "damping by --highest-damping, as that of a loop."
    )


def _reference_name(compared_with: str) -> str:
    """Return the name of the reference modes; explain the term "as drawn"."""
    if compared_with.endswith(" as drawn"):
        return f"{compared_with}, the nominal model"
    return compared_with


def _shift(measured: float, reference: float | None) -> float:
    """Return the relative shift of a reference frequency from the measured one [%]."""
    return 100 * ((reference or measured) / measured - 1)


def _percent(value: float) -> str:
    return percent_text(value, 3)


def list_remarks(result: IdentificationResult) -> list[str]:
    """Return one sentence for each finding that limits the modal model."""
    summary = result.summary
    sentences = [text.rstrip(".") + "." for text in summary.remarks]
    if not summary.modes:
        sentences.insert(0, _no_modes_sentence(summary))
    levels = summary.levels
    if levels is not None and levels.effects != [] and not levels.within_tests:
        sentences.append(
            "The tests of all levels were identified together, but the machine differs from level "
            "to level: some of these modes may stand for the difference, and channels of a body "
            "may contradict each other. For the modes at one level, list its tests alone in "
            "campaign.toml."
        )
    if summary.misfit > _MAX_MISFIT:
        sentences.append(
            f"The squared error of the modal model is {summary.misfit:.3g} times the variance of "
            "the noise: a mode may be missing. See the synthesis error of each channel and the "
            "stabilisation diagram."
        )
    if summary.normalisation != UNIT_MASS:
        channels = (map(result.layout.parse, names) for names in (summary.outputs, summary.inputs))
        sentences.append(missing_drive_point_sentence(result.layout, *map(tuple, channels)))
    sentences += _quality_remarks(result)
    for first, second in _lookalikes(result):
        sentences.append(
            f"Modes {first + 1} and {second + 1} have similar shapes (MAC "
            f"{result.arrays['auto_mac'][first, second]:.2f}) and similar frequencies: the sensors "
            "may be too few to distinguish them, or one mode was identified twice."
        )
    sentences += list_notes(summary)
    return [*sentences, *_exchanged_channels(summary), *_reversed_channels(result)]


def list_findings(result: IdentificationResult) -> list[str]:
    """Return the remarks, and what the checks say of each body and of the levels."""
    levels = result.summary.levels
    return [
        *list_remarks(result),
        *(row.words for row in result.summary.solid),
        *(() if levels is None else (levels.words,)),
    ]


def list_notes(summary: IdentifiedModesFile) -> list[str]:
    """Return the remarks that say how the result is shown; they do not make it doubtful."""
    sentences = []
    if summary.roved:
        sentences.append(
            "The hammer roved: by reciprocity, the points that were hit are listed here as "
            "outputs, the sensors as inputs."
        )
    if summary.undetermined_bodies:
        sentences.append(
            "The sensors do not determine all six directions of "
            f"{', '.join(summary.undetermined_bodies)}: the picture shows these bodies at rest and "
            "moves their sensors only."
        )
    return sentences


def _exchanged_channels(summary: IdentifiedModesFile) -> list[str]:
    """Return a sentence on each pair of exchanged sensors or channels."""
    swaps = {
        (fault.location, fault.dof): fault.probability
        for row in summary.solid
        for fault in row.faults
        if fault.effect == "sensor_swap"
    }
    sentences = []
    for (location, dof), probability in swaps.items():
        phrase = exchange_phrase(location, dof)
        sentences.append(
            f"{capitalise(phrase)} ({_percent(probability)}): exchange their cables or "
            "their labels."
        )
    return sentences


def _reversed_channels(result: IdentificationResult) -> list[str]:
    """Return a sentence on channels that move against their body and are not exchanged."""
    exchanged = {
        site
        for row in result.summary.solid
        for fault in row.faults
        if fault.effect == "sensor_swap"
        for site in fault.location.partition(":")[2].split("+")
    }
    arrays, outputs = result.arrays, result.summary.outputs
    channels = [
        label
        for label, value, is_known in zip(
            outputs, arrays["comac_solid"], arrays["is_solid"], strict=True
        )
        if is_known and value < 0 and label.rpartition(":")[0] not in exchanged
    ]
    if not channels:
        return []
    return [f"{', '.join(channels)} move against their body: check the polarity of these channels."]


def _quality_remarks(result: IdentificationResult) -> list[str]:
    """Return sentences on modes that are doubtful, badly scaled, uncertain or not reciprocal."""
    summary = result.summary
    sentences = []
    for number, row in enumerate(summary.modes, start=1):
        if row.doubtful:
            sentences.append(f"Mode {number} is doubtful: {'; '.join(row.doubtful)}.")
        if row.damping < 0:
            sentences.append(
                f"Mode {number} at {row.frequency:.4g} Hz grows, with a damping ratio of "
                f"{percent_text(row.damping, 3)}: the plant is unstable there, as can be "
                "measured in a closed loop; a drive point then takes power out of it."
            )
    spacing = float(np.diff(result.arrays["freq_hz"]).min(initial=np.inf))
    leaky = [
        row
        for row in summary.modes
        if 2 * abs(row.damping) * row.frequency < _MAX_LEAKY_LINES * spacing
    ]
    if leaky and not summary.hits and not result.arrays["decay"]:
        sentences.append(
            f"The half-power bandwidth of {_mode_numbers(result, leaky)} is below "
            f"{_MAX_LEAKY_LINES:g} lines of {spacing:.3g} Hz: such a mode rings longer than a "
            "segment, its lines leak, and under a Hann window the damping is that of the window. "
            "Measure longer segments, or leave these lines out by ignore_hz."
        )
    near_node = [row for row in summary.modes if (row.scale_sd or 0.0) > _MAX_SCALE_SD]
    if near_node:
        largest = 100 * max(row.scale_sd or 0.0 for row in near_node)
        sentences.append(
            f"A drive point lies near a node of {_mode_numbers(result, near_node)}: the size of "
            f"the shape has a standard deviation of up to {largest:.0f} %. Hit another point too "
            "before you rely on its scale."
        )
    uncertain = [
        row for row in summary.modes if row.damping_sd > _MAX_DAMPING_SD * abs(row.damping)
    ]
    if uncertain:
        sentences.append(
            f"The damping of {_mode_numbers(result, uncertain)} is uncertain by more than "
            f"{100 * _MAX_DAMPING_SD:.0f} %: the test hardly excites such a mode, or it is not a "
            "mode of the machine."
        )
    low = [row for row in summary.modes if (row.reciprocity or 1.0) < _MIN_RECIPROCITY]
    if low:
        sentences.append(
            "At the drive points, forces and motions are not reciprocal in "
            f"{_mode_numbers(result, low)}: check directions and places of hammer and sensor "
            "before you rely on the scale of the shapes."
        )
    return sentences


def _mode_numbers(result: IdentificationResult, rows: list[IdentifiedModeRow]) -> str:
    numbers = [str(result.summary.modes.index(row) + 1) for row in rows]
    return ("mode " if len(numbers) == 1 else "modes ") + ", ".join(numbers)


def _lookalikes(result: IdentificationResult) -> list[tuple[int, int]]:
    """Return pairs of modes with similar shapes and frequencies."""
    count = len(result.summary.modes)
    freq = np.array([row.frequency for row in result.summary.modes])
    is_similar = np.triu(result.arrays["auto_mac"][:count, :count] > _MIN_LOOKALIKE_MAC, 1)
    is_similar &= np.abs(freq[:, None] / freq - 1) < _MAX_LOOKALIKE_SHIFT
    return [(int(first), int(second)) for first, second in np.argwhere(is_similar)]
