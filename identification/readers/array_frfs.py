"""FRFs from MATLAB, numpy and text files, whose channels campaign.toml names."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.readers.array_files import is_text, load_arrays
from identification.readers.array_noise import input_spectra as find_input_spectra
from identification.readers.array_noise import stated_variance
from identification.readers.channel_labels import parse_channels, parse_references
from identification.readers.frf_table import FrfTable, real_coherence
from identification.readers.frf_units import labelled_unit, parse_frf_units, unit_remarks
from identification.readers.text_arrays import fold_columns
from identification.readers.units import frequency_factor
from identification.words import (
    MAX_INPUT_MAGNITUDE,
    Complex,
    Input,
    InputError,
    Output,
    Quantity,
    Real,
)


def read_arrays(
    path: Path,
    *,
    channels: str | list[str],
    references: list[str],
    quantity: Quantity,
    unit: str | None,
    input_spectra: str | None = None,
    frequency_unit: str | None = None,
    columns: Sequence[int | str] | None = None,
) -> FrfTable:
    """Read the FRFs of a .mat file (FRFs, COHs, freqs), .npz file or text file.

    An .npz file has frf, coherence and freq_hz; headings say what a text file has.

    The axes of the FRFs are (out, in, freq), as is usual in MATLAB, or (freq, out, in). The
    lengths of the three axes decide; if both fit, frequency is the first axis. Coherence is
    optional, as are variance, covariance over channels and spectra of the inputs.

    Args:
        channels: ``"nodes 1..23, xyz"`` or a list of labels.
        references: labels of the references, or names of motors.
        unit: units such as ``g/N`` or ``g/N, rad/s^2/(N m)``; None for SI.
        input_spectra: name of the array of the inputs' cross spectra, if it is not the usual one.
        frequency_unit: unit of the frequencies; None for what a heading says, else Hz.
        columns: headings or numbers of the columns of a text file; None for all.

    Raises:
        InputError: the file is unreadable, or its arrays contradict channels or references.
    """
    responses = parse_channels(path, channels)
    inputs = parse_references(path, references)
    names = ("FRFs", "COHs", "freqs") if path.suffix.lower() == ".mat" else (
        "frf", "coherence", "freq_hz")  # fmt: skip
    arrays = load_arrays(path, columns)
    for name in (names[0], names[2]):
        if name not in arrays:
            raise InputError(
                f"{path} has no variable {name!r} (it has {', '.join(sorted(arrays)) or 'none'}): "
                "save it under that name"
            )
    _refuse_non_numbers(path, arrays, names)
    hertz, remarks = frequency_factor(path, frequency_unit, str(arrays.get("freq_label", "")))
    freq_hz = hertz * np.real(arrays[names[2]]).astype(float).ravel()
    shape = (len(freq_hz), len(responses), len(inputs))
    if is_text(path):
        remarks += fold_columns(path, arrays, shape)
    values: Complex = _freq_first(path, names[0], np.asarray(arrays[names[0]]), shape) + 0j
    coherence = arrays.get(names[1])
    if coherence is not None:
        real = real_coherence(f"{path}: {names[1]}", np.asarray(coherence))
        coherence = _freq_first(path, names[1], real, shape)
    if not (np.isfinite(freq_hz).all() and (np.diff(freq_hz) > 0).all() and freq_hz.size):
        raise InputError(
            f"{path}: {names[2]} does not increase strictly: sort it and drop repeated lines"
        )
    for name, table in ((names[1], coherence), (names[0], values)):
        if table is not None:
            _refuse_nan(path, name, table, freq_hz, responses, inputs)
    unit, label_remarks = labelled_unit(path, arrays, quantity, unit)
    units = parse_frf_units(path, quantity, unit)
    factors = units.factors(responses, inputs)
    variance = stated_variance(path, arrays, values)
    spectra = find_input_spectra(path, arrays, input_spectra, shape)
    if spectra is not None:  # a factor 1 / f_j of an FRF is one f_j of the input
        spectra = spectra / np.multiply.outer(factors[0], factors[0])
    return FrfTable(
        freq_hz=freq_hz,
        values=values * factors,
        coherence=coherence,
        measured=np.ones(shape[1:], bool),
        responses=responses,
        references=inputs,
        quantity=quantity,
        remarks=(*remarks, *label_remarks, *unit_remarks(path, units, responses, inputs)),
        variance=None if variance is None else variance * factors**2,
        input_spectra=spectra,
    )


def _refuse_non_numbers(path: Path, arrays: dict[str, np.ndarray], names: tuple[str, ...]) -> None:
    """Refuse arrays without numbers, and complex frequencies."""
    for name in names:
        if name in arrays and np.asarray(arrays[name]).dtype.kind not in "fiuc":
            raise InputError(f"{path}: {name} is not an array of numbers: save it as one")
    if np.any(np.imag(arrays[names[2]])):
        raise InputError(f"{path}: {names[2]} is complex: save real frequencies in Hz")


def _freq_first(
    path: Path, name: str, array: np.ndarray, shape: tuple[int, int, int]
) -> np.ndarray:
    """Return an array with the axes (freq, out, in) of the given shape."""
    stored = array.shape
    if array.ndim == 2 and shape[2] == 1:
        array = array[:, :, None] if stored == shape[:2] else array[:, None, :]
    if array.shape == shape:
        return array
    if array.shape == (*shape[1:], shape[0]):
        return np.moveaxis(array, 2, 0)
    raise InputError(f"{path}: {_describe_other_shape(name, stored, shape)}")


def _describe_other_shape(name: str, stored: tuple[int, ...], shape: tuple[int, int, int]) -> str:
    """Return what the shape of an array shows: other lines, another order of axes, or neither."""
    lines, outputs, inputs = shape
    across = shape[1 : len(stored)] if inputs == 1 else shape[1:]
    if across in (stored[1:], stored[:-1]):
        count = stored[0] if stored[1:] == across else stored[-1]
        return (
            f"{name} has {count} lines, and the file has {lines} frequencies: save the same lines "
            "of both"
        )
    usual = (outputs, inputs, lines)
    if sorted(stored) == sorted(shape):
        return (
            f"{name} has shape {stored}, its axes are in another order: save them as (out, in, "
            f"freq), {usual}, or as (freq, out, in), {shape}"
        )
    return (
        f"{name} has shape {stored}, but {outputs} channels, {inputs} references and {lines} "
        f"frequencies need {usual}: correct channels or references"
    )


def _refuse_nan(
    path: Path,
    name: str,
    array: Complex | Real,
    freq_hz: Real,
    responses: tuple[Output, ...],
    inputs: tuple[Input, ...],
) -> None:
    """Refuse an array with NaN or values beyond any measurement; name frequency and channel."""
    bad = np.argwhere(~(np.abs(array) <= MAX_INPUT_MAGNITUDE))  # also true for NaN
    if bad.size:
        line, row, column = bad[0]
        raise InputError(
            f"{path}: {name} holds NaN, infinity or a value beyond {MAX_INPUT_MAGNITUDE:g} at "
            f"{freq_hz[line]:g} Hz, response {responses[row]}, reference {inputs[column]}: export "
            "it again"
        )
