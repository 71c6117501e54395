"""Relative error of the plant at its inputs, on held-out lines, corrected for the noise.

With H measured and G predicted by the fit that left the line out, H = G (1 + E) has

    E = G^+ (H - G),   G^+ the pseudo-inverse,

an error at the inputs (multiplicative input uncertainty; Skogestad and Postlethwaite 2005, ch. 8).
The noise adds S = G^+ diag(sum over inputs of var) G^+' to the mean of E E'. So the size of E
without it is

    e = sqrt(largest eigenvalue of E E' - S), or 0.

In a window around each line the quantile of e over lines and files is what a weight has to bound.

A control loop whose own plant was measured has the error of that one FRF, e^2 = |E|^2 - var/|G|^2.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, InputError, Integers, Loop, Real, split_label
from tuning.files.plant_folder import HeldOutResult
from tuning.files.result import LevelFrfs

_WINDOW_SHARE = 0.05  # of the lines, where no held-out block says how wide a resonance is
_MIN_ERROR_SHARE = 1e-3  # of the largest quantile: below it noise hides the error
_SINGULAR_SHARE = 1e-10  # of the largest singular value of G: a direction in which nothing moves


@dataclass(frozen=True, eq=False)
class MultiplicativeError:
    """Error at the inputs, at the frequencies of a tuning.

    Args:
        freq_hz: lines above 0 Hz [Hz]; (n_freq,).
        errors: e of each file; (n_file, n_freq).
        quantile: of e in a window around each line, above zero; (n_freq,).
        probability: of the quantile.
    """

    freq_hz: Real
    errors: Real
    quantile: Real
    probability: float


def held_out_input_error(result: HeldOutResult, probability: float = 0.95) -> MultiplicativeError:
    """Return the error at the inputs of a tuning on its held-out lines.

    Args:
        probability: of the quantile over the lines of a window.

    Raises:
        InputError: the tuning has no held-out predictions.
    """
    frfs = result.levels["sensors"]
    if frfs.held_out is None:
        raise InputError(
            "the fit predicted no held-out lines, so that the error of its model is not known: "
            "fit with residual log in a wider band"
        )
    columns = _columns_of_files(frfs)
    errors = [_errors_of_file(frfs, frfs.held_out, each) for each in columns]
    return _with_quantile(result, np.array(errors), probability)


def held_out_loop_error(
    result: HeldOutResult, loop: Loop, probability: float = 0.95
) -> MultiplicativeError | None:
    """Return the held-out error of the plant of a control loop.

    It is that of the FRF from the loop's input to what it measures, if a file holds it. Else it is
    the error at the inputs, which has a meaning if all inputs have one unit.

    Args:
        loop: its input, and what it measures.
        probability: of the quantile over the lines of a window.

    Returns:
        None where the tuning knows nothing of it.
    """
    frfs = result.levels["sensors"]
    if frfs.held_out is None:
        return None
    of_plant = [
        _error_of_sum(frfs, frfs.held_out, columns) for columns in _columns_of_loop(frfs, loop)
    ]
    if of_plant:
        return _with_quantile(result, np.array(of_plant), probability)
    return held_out_input_error(result, probability) if has_one_input_unit(frfs) else None


def has_one_input_unit(frfs: LevelFrfs) -> bool:
    """Return whether all inputs have one unit, without which their error depends on the units."""
    inputs = {test.partition(" in ")[0] for test in frfs.tests}
    kinds = {split_label(label)[1][:1] or label for label in inputs}  # t, r, or a motor's name
    return len(kinds) == 1


def _with_quantile(result: HeldOutResult, every: Real, probability: float) -> MultiplicativeError:
    """Return errors with their quantile in a window around each line.

    Args:
        result: the tuning.
        every: e of each file at all lines; (n_file, n_line).
    """
    lines = np.flatnonzero(result.freq_hz > 0)
    errors = every[:, lines]
    blocks = result.blocks
    width = len(lines) // blocks if blocks else max(3, int(_WINDOW_SHARE * len(lines)))
    quantile = np.empty(len(lines))
    for k in range(len(lines)):
        start = min(max(0, k - width // 2), max(0, len(lines) - width))
        quantile[k] = np.quantile(errors[:, start : start + width], probability)
    largest = float(quantile.max(initial=0.0))
    least = _MIN_ERROR_SHARE * largest if largest > 0 else np.finfo(float).eps
    return MultiplicativeError(
        result.freq_hz[lines], errors, np.maximum(quantile, least), probability
    )


def _columns_of_loop(frfs: LevelFrfs, loop: Loop) -> list[list[tuple[int, float]]]:
    """Return, for each file with all FRFs of a loop's plant, their columns and weights."""
    files: dict[str, dict[str, int]] = {}
    for column, (output, test) in enumerate(zip(frfs.outputs, frfs.tests, strict=True)):
        reference, _, file = test.partition(" in ")
        if reference == str(loop.input):
            files.setdefault(file, {})[output] = column
    terms = [(str(port), weight) for port, weight in loop.measured.terms]
    return [
        [(columns[output], weight) for output, weight in terms]
        for columns in files.values()
        if all(output in columns for output, _ in terms)
    ]


def _error_of_sum(frfs: LevelFrfs, predicted: Complex, columns: list[tuple[int, float]]) -> Real:
    """Return e of a weighted sum of FRFs; (n_freq,)."""
    numbers = [column for column, _ in columns]
    weights = np.array([weight for _, weight in columns])
    model = predicted[:, numbers].astype(complex) @ weights
    error = frfs.measured[:, numbers] @ weights - model
    variance = np.asarray(frfs.noise, float)[:, numbers] ** 2 @ weights**2
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.sqrt(np.maximum(np.abs(error) ** 2 - variance, 0.0)) / np.abs(model)
    return np.nan_to_num(size)


def _columns_of_files(frfs: LevelFrfs) -> list[Integers]:
    """Return, for each file, the columns of its channels and references; (n_out, n_in) each.

    Channels that some reference of the file lacks are left out.
    """
    files: dict[str, dict[str, dict[str, int]]] = {}
    for column, (output, test) in enumerate(zip(frfs.outputs, frfs.tests, strict=True)):
        reference, _, file = test.partition(" in ")
        files.setdefault(file, {}).setdefault(reference, {})[output] = column
    tables: list[Integers] = []
    for references in files.values():
        shared = [
            output
            for output in next(iter(references.values()))
            if all(output in of_reference for of_reference in references.values())
        ]
        if shared:
            tables.append(
                np.array(
                    [[columns[output] for columns in references.values()] for output in shared]
                )
            )
    return tables


def _errors_of_file(frfs: LevelFrfs, predicted: Complex, columns: Integers) -> Real:
    """Return e of the FRFs of one file; (n_freq,).

    Args:
        frfs: measured FRFs and their noise.
        predicted: held-out predictions; (n_freq, n_channel).
        columns: of outputs and inputs; (n_out, n_in).
    """
    model = predicted[:, columns].astype(complex)
    inverse = np.linalg.pinv(model, rcond=_SINGULAR_SHARE)
    error = inverse @ (frfs.measured[:, columns] - model)
    variance = (np.asarray(frfs.noise, float)[:, columns] ** 2).sum(axis=2)
    noise = (inverse * variance[:, None, :]) @ inverse.conj().swapaxes(1, 2)
    power = np.linalg.eigvalsh(error @ error.conj().swapaxes(1, 2) - noise)[:, -1]
    return np.sqrt(np.maximum(power, 0.0))
