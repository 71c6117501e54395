r"""Comparison of what the references say of the same modes, and correction of the run that is off.

The receptance residues of a mode have rank one, R_oi = phi_o l_i. Each reference is therefore
identified alone, its modes are matched with those of the base reference, and for each mode

    R_oi = c_oi a_i R_ob,    f_i = (1 + e_i) f_b,

with a_i = l_i / l_b. A channel with one factor c over all modes has another sign or gain in that
run. One shift e of all modes says that the machine changed between runs. A factor -1 in one mode at
a drive point, whose power is negative there, is a wrong sign of that residue.

A correction is kept if the joint identification then needs fewer modes, or half the squared error.
Otherwise something else makes references differ, and the data stay as they are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.modal.drive_residues import find_negative_residues, negative_residue_phrase
from identification.modal.mode_selection import IdentifiedModes
from identification.modal.shape_fit import WeightedFrfs
from identification.words import Complex, Integers, Mask, Real

_MAX_NOISE_MISFIT = 1.5  # squared error over the variance of the noise that noise alone may give
_MAX_RUN_SHIFT = 0.05  # largest relative shift of frequencies between two runs, as between set-ups
_MIN_FAULT_DEVIATIONS = 5.0  # standard deviations of a shift or factor that chance does not give
_MIN_SHIFT = 1e-4  # relative; the files of analysers round frequencies less
_MIN_GAIN_ERROR = 0.02  # calibrations of accelerometers agree within 1 to 2 %
_MAX_RATIO_SD = 0.1  # standard deviation of a ratio of residues in a mode that tells a factor
_MAX_FACTOR_SPREAD = 0.3  # distance of a mode from the common factor over that of the factor from 1
_MIN_AGREEING_SHARE = 0.75  # modes with the common factor, of those that tell one
_MAX_FAULTY_SHARE = 0.34  # channels with a factor; more, and the reference is not the same modes'
_MIN_MODES = 2  # modes for a factor: one mode alone may be two of nearly one frequency


@dataclass(frozen=True, eq=False)
class Alignment:
    """FRFs in which a fault of one run is corrected.

    Args:
        values: corrected FRFs; (n_freq, n_out, n_in).
        sentences: what was corrected, one sentence a fault.
    """

    values: Complex
    sentences: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Labels:
    outputs: Sequence[str]
    inputs: Sequence[str]
    is_drive: Mask  # (n_out, n_in)


@dataclass(frozen=True, eq=False)
class _Comparison:
    """One reference beside the base reference.

    Args:
        shift: e; 0 if it is within its uncertainty.
        factors: c of each channel; 1 if it is within its uncertainty; (n_out,).
        reversed_cells: channel and mode, of the base and of this reference, where one has the
            opposite sign.
    """

    shift: float
    factors: Real
    reversed_cells: tuple[tuple[int, int, int], ...]


def needs_alignment(identified: IdentifiedModes) -> bool:
    """Return whether references may disagree: beyond noise, or with two modes of one frequency."""
    fit = identified.fit
    if len(fit.participation) < 2 or not identified.inside.any():  # two references
        return False
    poles = fit.poles[identified.inside]
    near = np.abs(poles[:, None] - poles) < np.abs(poles.real)
    return bool(identified.misfit > _MAX_NOISE_MISFIT or near.sum() > len(poles))


def is_better(aligned: IdentifiedModes, identified: IdentifiedModes) -> bool:
    """Return whether corrected references need fewer modes, or leave half the squared error."""
    fewer = int(aligned.inside.sum()) < int(identified.inside.sum())
    limit = max(_MAX_NOISE_MISFIT, identified.misfit)
    return bool(aligned.misfit < identified.misfit / 2 or (fewer and aligned.misfit <= 1.1 * limit))


def align_references(
    data: WeightedFrfs,
    outputs: Sequence[str],
    inputs: Sequence[str],
    identify_column: Callable[[WeightedFrfs], IdentifiedModes],
) -> Alignment | None:
    """Find and correct what one reference has wrong; None if nothing is found.

    Args:
        outputs: labels of the channels, along positive axes; n_out.
        inputs: labels of the references; n_in.
        identify_column: identification of the FRFs of one reference.
    """
    labels = _Labels(outputs, inputs, np.array([[o == i for i in inputs] for o in outputs]))
    columns = [identify_column(_select_column(data, inp)) for inp in range(len(inputs))]
    base = int(np.argmax([column.inside.sum() for column in columns]))
    compared = {
        inp: _compare(columns[base], column) for inp, column in enumerate(columns) if inp != base
    }
    corrections = _Corrections(data, columns, labels, base)
    for inp, comparison in compared.items():
        corrections.remove_shift(inp, comparison.shift)
    for inp, out, mode in _find_reversed_cells(columns, base, compared, labels):
        corrections.reverse_mode(inp, out, mode)
    factors = np.ones((len(outputs), len(inputs)))
    for inp, comparison in compared.items():
        factors[:, inp] = comparison.factors
    if len(inputs) > 2:  # most runs are right: their median tells which one is not
        factors /= np.median(factors, axis=1, keepdims=True)
    for out, inp in np.argwhere(factors != 1.0):
        corrections.divide(int(out), int(inp), float(factors[out, inp]))
    if not corrections.sentences:
        return None
    return Alignment(corrections.values, tuple(corrections.sentences))


class _Corrections:
    """FRFs that are corrected step by step, with a sentence for each step."""

    def __init__(
        self,
        data: WeightedFrfs,
        columns: Sequence[IdentifiedModes],
        labels: _Labels,
        base: int,
    ) -> None:
        self.data, self.columns, self.labels, self.base = data, columns, labels, base
        self.values: Complex = data.values
        self.sentences: list[str] = []

    def _writable_values(self) -> Complex:
        """Return the values, which are those of the data until the first correction."""
        if self.values is self.data.values:
            self.values = self.values.copy()
        return self.values

    def remove_shift(self, inp: int, shift: float) -> None:
        """Move a run to the frequencies of the base reference; its noise stays.

        An accelerance keeps its form with stretched frequencies.
        """
        if not shift:
            return
        fit, data = self.columns[inp].fit, self.data
        moved = fit.values(data.laplace * (1 + shift), data.order) * (1 + shift) ** (2 - data.order)
        self._writable_values()[:, :, [inp]] += moved - fit.values(data.laplace, data.order)
        base = self.labels.inputs[self.base]
        self.sentences.append(
            f"frequencies shift by {100 * shift:+.2g} % from the run with the reference {base} to "
            f"that with {self.labels.inputs[inp]}: the machine changed between both; the modes are "
            f"those of the run with {base}"
        )

    def reverse_mode(self, inp: int, out: int, mode: int) -> None:
        """Reverse the sign of one mode in one FRF."""
        fit, data = self.columns[inp].fit, self.data
        shapes = fit.shapes * (np.arange(len(fit.poles)) == mode)
        alone = replace(fit, shapes=shapes, lower=0 * fit.lower, upper=0 * fit.upper)
        self._writable_values()[:, out, inp] -= (
            2 * alone.values(data.laplace, data.order)[:, out, 0]
        )
        phrase = negative_residue_phrase(self.labels.inputs[inp])
        self.sentences.append(
            f"mode at {fit.freq_hz[mode]:.4g} Hz: {phrase}; the sign was changed here"
        )

    def divide(self, out: int, inp: int, factor: float) -> None:
        """Divide one FRF by a factor."""
        self._writable_values()[:, out, inp] /= factor
        self.sentences.append(_factor_sentence(factor, self.labels, out, inp, self.base))


def _select_column(data: WeightedFrfs, inp: int) -> WeightedFrfs:
    """Return the FRFs of one reference."""
    weights = data.weights if data.separable else data.weights[:, :, [inp]]
    return replace(
        data, values=data.values[:, :, [inp]], weights=weights, cells=data.cells[:, [inp]]
    )


def _compare(base: IdentifiedModes, column: IdentifiedModes) -> _Comparison:
    """Return the shift and the factors of a reference against the base reference."""
    n_out = len(base.fit.shapes)
    nothing = _Comparison(0.0, np.ones(n_out), ())
    pairs = _match(base, column)
    if len(pairs) < _MIN_MODES:
        return nothing
    first, second = pairs.T
    residues = [
        modes.fit.shapes[:, chosen] * modes.fit.participation[0, chosen]
        for modes, chosen in ((base, first), (column, second))
    ]
    deviations = [
        modes.residue_sd[:, 0, chosen] for modes, chosen in ((base, first), (column, second))
    ]
    scale = _common_scale(*residues)
    expected, deviation = (
        residues[0] * scale,
        np.hypot(deviations[0] * np.abs(scale), deviations[1]),
    )
    size = np.maximum(np.abs(expected), np.finfo(float).tiny)
    ratio = (residues[1] * (expected / size).conj()).real / size
    ratio_sd = deviation / size
    clear = ratio_sd < _MAX_RATIO_SD
    factors = np.array([_find_factor(*row) for row in zip(ratio, ratio_sd, clear, strict=True)])
    if (factors != 1.0).sum() > _MAX_FAULTY_SHARE * clear.any(axis=1).sum():
        factors = np.ones(n_out)
    is_reversed = clear & (ratio / factors[:, None] < -0.5)  # opposite sign, at least half the size
    cells = tuple((int(o), int(first[k]), int(second[k])) for o, k in np.argwhere(is_reversed))
    return _Comparison(_find_shift(base, column, pairs), factors, cells)


def _match(base: IdentifiedModes, column: IdentifiedModes) -> Integers:
    """Return the pairs of modes of two references, at the shift that matches most; (n_pair, 2)."""
    first, second = (np.flatnonzero(modes.inside) for modes in (base, column))
    freq_1, freq_2 = base.fit.freq_hz[first], column.fit.freq_hz[second]
    width = np.maximum(np.abs(base.fit.damping[first]), _MIN_SHIFT)
    if not len(first) or not len(second):
        return np.zeros((0, 2), np.intp)
    ratios = (freq_2 / freq_1[:, None]).ravel()
    best = np.zeros((len(first), len(second)), bool)
    score = (0.0, 0.0)
    for ratio in [1.0, *ratios[np.abs(ratios - 1) < _MAX_RUN_SHIFT]]:
        distance = np.abs(freq_2 / ratio / freq_1[:, None] - 1) / width[:, None]
        nearest = distance == distance.min(axis=1, keepdims=True)
        nearest &= (distance == distance.min(axis=0)) & (distance < 1)
        candidate = float(nearest.sum()), -float(distance[nearest].sum())
        if candidate > score:
            best, score = nearest, candidate
    rows, columns = np.nonzero(best)
    return np.stack([first[rows], second[columns]], axis=1)


def _find_shift(base: IdentifiedModes, column: IdentifiedModes, pairs: Integers) -> float:
    """Return the shift that all modes share; 0 within its uncertainty, or if they share none."""
    first, second = pairs.T
    shifts = column.fit.freq_hz[second] / base.fit.freq_hz[first] - 1
    deviations = np.hypot(
        column.freq_sd[second] / column.fit.freq_hz[second],
        base.freq_sd[first] / base.fit.freq_hz[first],
    )
    shift = float(np.median(shifts))
    usual = float(np.median(np.abs(shifts - shift)))
    noise = float(np.median(deviations)) / np.sqrt(len(pairs))
    is_shared = usual < _MAX_FACTOR_SPREAD * abs(shift)
    is_clear = abs(shift) > max(_MIN_SHIFT, _MIN_FAULT_DEVIATIONS * noise)
    return shift if is_shared and is_clear else 0.0


def _common_scale(first: Complex, second: Complex) -> Complex:
    """Return a of each mode: second = a first in as many channels as possible; (n_mode,).

    Of the ratios of all channels, the one with the smallest sum of distances |R - a R_b|, each over
    its size, is taken: channels count alike, and a minority may be wrong.
    """
    tiny = np.finfo(float).tiny
    ratios = second / np.where(first == 0, 1.0, first)
    difference = np.abs(second[:, None] - ratios * first[:, None])
    size = np.sqrt(np.abs(second[:, None]) ** 2 + np.abs(ratios * first[:, None]) ** 2)
    # The difference has a meaning only beside the largest entries of both.
    floor = 0.05 * np.abs(second).max(axis=0)
    cost = (difference / np.maximum(size, np.maximum(floor, tiny))).sum(axis=0)
    return ratios[cost.argmin(axis=0), np.arange(first.shape[1])]


def _find_factor(ratio: Real, deviation: Real, clear: Mask) -> float:
    """Return the factor of a channel that its modes share; 1 within its uncertainty."""
    if clear.sum() < _MIN_MODES:
        return 1.0
    ratio, deviation = ratio[clear], deviation[clear]
    factor = float(np.median(ratio))
    distance = abs(factor - 1)
    shared = np.abs(ratio - factor) < _MAX_FACTOR_SPREAD * distance
    noise = float(np.median(deviation)) / np.sqrt(len(ratio))
    is_clear = distance > max(_MIN_GAIN_ERROR, _MIN_FAULT_DEVIATIONS * noise)
    if not is_clear or shared.mean() < _MIN_AGREEING_SHARE or shared.sum() < _MIN_MODES:
        return 1.0
    return -1.0 if abs(factor + 1) < _MIN_GAIN_ERROR else factor


def _find_reversed_cells(
    columns: Sequence[IdentifiedModes],
    base: int,
    compared: dict[int, _Comparison],
    labels: _Labels,
) -> list[tuple[int, int, int]]:
    """Return reference, channel and mode of drive points whose residue has the wrong sign."""
    wrong: set[tuple[int, int, int]] = set()
    for inp, comparison in compared.items():
        for out, base_mode, mode in comparison.reversed_cells:
            for place, number in ((base, base_mode), (inp, mode)):
                column = columns[place]
                if labels.is_drive[out, place] and number in find_negative_residues(
                    column.fit.poles,
                    column.fit.shapes[out] * column.fit.participation[0],
                    column.residue_sd[out, 0],
                    column.inside,
                ):
                    wrong.add((place, out, number))
    return sorted(wrong)


def _factor_sentence(factor: float, labels: _Labels, out: int, inp: int, base: int) -> str:
    """Say which channel has another sign or gain in one run."""
    name, reference = labels.outputs[out], labels.inputs[inp]
    if len(labels.inputs) > 2:  # a majority tells which run is wrong
        place, corrected = f"in the run with the reference {reference}", "there"
    else:
        place = f"in one of the runs, with {reference} beside that with {labels.inputs[base]}"
        corrected = f"at {reference}, since two runs do not tell which is wrong"
    if factor < 0:
        size = "" if factor == -1.0 else f" and {abs(factor):.3g} times the gain"
        fault = f"reads with the opposite sign{size}"
    else:
        fault = f"has {abs(factor):.3g} times the gain"
    return f"{name} {fault} {place}: check its cable and calibration; it was corrected {corrected}"
