"""Noise that stands beside FRFs in array files: variances, covariances, spectra of the inputs."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from identification.words import MAX_INPUT_MAGNITUDE, Complex, InputError, Real

VARIANCE, COVARIANCE, INPUT_SPECTRA = "variance", "covariance", "input_spectra"
_MAX_IMAGINARY_SHARE = 1e-6  # relative imaginary part that rounding leaves of a variance
_MAX_DISAGREEMENT = 1e-2  # relative, of a variance and the diagonal of a covariance


def stated_variance(path: Path, arrays: Mapping[str, np.ndarray], frf: Complex) -> Real | None:
    """Return the variance of each FRF value that a file states, or None.

    It is E|error|^2, real plus imaginary part, in the square of the unit of the FRFs. Of
    ``covariance`` over channels the diagonal is used, since fits weigh channels as independent.

    Args:
        frf: FRFs in the units of the file; (n_freq, n_out, n_in).

    Raises:
        InputError: an array has the wrong shape, or values that are no variances.
    """
    lines, outputs, inputs = frf.shape
    variance = covariance = None
    if VARIANCE in arrays:
        shapes = [frf.shape, (outputs, inputs, lines)]
        variance = _arrange(path, VARIANCE, arrays[VARIANCE], shapes)
        variance = variance if variance.shape == frf.shape else np.moveaxis(variance, 2, 0)
    if COVARIANCE in arrays:
        covariance = _channel_diagonal(path, arrays[COVARIANCE], frf.shape)
    if variance is not None and covariance is not None:
        difference = np.abs(variance - covariance)
        if (difference > _MAX_DISAGREEMENT * np.abs(variance)).any():
            raise InputError(
                f"{path}: {VARIANCE} differs from the diagonal of {COVARIANCE}: leave one out"
            )
    name = VARIANCE if variance is not None else COVARIANCE
    values = variance if variance is not None else covariance
    return None if values is None else _check_variance(path, name, values, frf)


def input_spectra(
    path: Path, arrays: Mapping[str, np.ndarray], name: str | None, shape: tuple[int, int, int]
) -> Complex | None:
    """Return the cross spectra of the inputs that a file holds, or None; (n_freq, n_in, n_in).

    Args:
        name: name of the array by campaign.toml; None for the usual name, if there is one.
        shape: shape of the FRFs (n_freq, n_out, n_in).

    Raises:
        InputError: a named array is missing, or its shape or values are wrong.
    """
    if name is not None and name not in arrays:
        raise InputError(
            f"{path} has no variable {name!r} (it has {', '.join(sorted(arrays))}): correct "
            "input_spectra in its [[test]]"
        )
    name = name or INPUT_SPECTRA
    if name not in arrays:
        return None
    lines, _, inputs = shape
    wanted = (lines, inputs, inputs)
    spectra = _arrange(path, name, arrays[name], [wanted, (inputs, inputs, lines)])
    spectra = spectra if spectra.shape == wanted else np.moveaxis(spectra, 2, 0)
    _refuse_other_numbers(path, name, spectra)
    return np.asarray(spectra, np.complex128)


def _channel_diagonal(path: Path, array: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Return the diagonal over channels of a covariance; (n_freq, n_out, n_in)."""
    lines, outputs, inputs = shape
    axes = {
        (lines, outputs, outputs, inputs): "fooi->foi",
        (lines, inputs, outputs, outputs): "fioo->foi",
        (outputs, outputs, inputs, lines): "ooif->foi",
        (inputs, outputs, outputs, lines): "ioof->foi",
    }
    if inputs == 1 and np.ndim(array) == 3:
        array = array[..., None] if array.shape[0] == lines else array[:, :, None]
    array = _arrange(path, COVARIANCE, array, list(axes))
    return np.asarray(np.einsum(axes[array.shape], array))


def _arrange(path: Path, name: str, array: np.ndarray, shapes: list[tuple[int, ...]]) -> np.ndarray:
    """Return an array of numbers that has one of the shapes, up to axes of length one."""
    array = np.asarray(array)
    if array.dtype.kind not in "fiuc":
        raise InputError(f"{path}: {name} is not an array of numbers: save it as one")
    if array.shape in shapes:
        return array
    long = tuple(length for length in array.shape if length > 1)
    for shape in shapes:
        if 1 in shape and long == tuple(length for length in shape if length > 1):
            return array.reshape(shape)
    raise InputError(
        f"{path}: {name} has shape {array.shape}, but its FRFs need {shapes[0]}: save it so"
    )


def _refuse_other_numbers(path: Path, name: str, values: np.ndarray) -> None:
    """Refuse NaN, infinity and values beyond any measurement."""
    if not (np.abs(np.asarray(values, complex)) <= MAX_INPUT_MAGNITUDE**2).all():  # also for NaN
        raise InputError(f"{path}: {name} holds NaN, infinity or absurd values: export it again")


def _check_variance(path: Path, name: str, values: np.ndarray, frf: Complex) -> Real:
    """Return variances as real numbers; refuse negative ones, and none where an FRF has values."""
    _refuse_other_numbers(path, name, values)
    real = np.asarray(np.real(values), np.float64)
    if (np.abs(np.imag(values)) > _MAX_IMAGINARY_SHARE * np.abs(real)).any():
        raise InputError(f"{path}: {name} is complex: save E|error|^2, real plus imaginary part")
    if (real < 0).any() or (real[frf != 0] == 0).any():
        raise InputError(
            f"{path}: {name} is {real[frf != 0].min(initial=0.0):g} where the FRFs have values: "
            "each has noise, so save its variance, or leave the array out"
        )
    return real
