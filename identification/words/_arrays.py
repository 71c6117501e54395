"""Array types, and read-only copies of arrays whose shape and finiteness are checked."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Integers = NDArray[np.intp]
# Limit of forces, motions, frequencies, lengths and FRFs that a file states, in SI units: those of
# machines are smaller, and squares and ratios of numbers below it stay finite.
MAX_INPUT_MAGNITUDE = 1e30
# Limits of frequency lines and of sampling rates [Hz], some decades beyond those of any machine.
MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ = 1e-9, 1e8


def frozen_array(
    value: ArrayLike,
    dtype: type[np.generic],
    shape: tuple[int | None, ...],
    name: str,
    limit: float = np.inf,
) -> NDArray[Any]:
    """Return a read-only copy of an array after checking its shape and finiteness.

    An array that nobody can write to, as this function returns it, is its own copy.

    Args:
        value: array to copy.
        dtype: numpy type of the copy.
        shape: expected shape; ``None`` for any length.
        name: name of the array in messages.
        limit: largest magnitude of a value.

    Raises:
        ValueError: the shape differs, or a value is NaN, infinite or beyond the limit.
    """
    array = np.asarray(value) if _is_frozen(value, dtype) else np.array(value, dtype=dtype)
    fits = array.ndim == len(shape) and all(
        length in (None, actual) for length, actual in zip(shape, array.shape, strict=True)
    )
    if not fits:
        expected = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
        raise ValueError(f"{name} has shape {array.shape}, expected {expected}")
    if np.issubdtype(array.dtype, np.inexact) and not _is_within(array, limit):
        _refuse_value(array, name, limit)
    array.flags.writeable = False
    return array


def _is_frozen(value: ArrayLike, dtype: type[np.generic]) -> bool:
    """Return whether a value is an array of this type whose memory no array can write to."""
    if type(value) is not np.ndarray or value.dtype != dtype:
        return False
    owner: object = value
    while isinstance(owner, np.ndarray) and not owner.flags.writeable:
        owner = owner.base
    return owner is None


def _is_within(array: NDArray[Any], limit: float) -> bool:
    """Return whether all values are finite and surely below a limit, without another array."""
    parts = (array.real, array.imag) if np.iscomplexobj(array) else (array,)
    ends = [abs(float(end)) for part in parts if part.size for end in (part.min(), part.max())]
    return all(end <= limit / 2 and np.isfinite(end) for end in ends)


def _refuse_value(array: NDArray[Any], name: str, limit: float) -> None:
    """Raise ValueError for the first value that is not finite or beyond a limit, if any is."""
    if (bad := np.argwhere(~np.isfinite(array))).size:
        raise ValueError(f"{name} is not finite at index {tuple(int(i) for i in bad[0])}")
    if np.isfinite(limit) and (beyond := np.argwhere(np.abs(array) > limit)).size:
        where = tuple(int(i) for i in beyond[0])
        raise ValueError(f"{name} is {np.abs(array[where]):g} at index {where}, beyond {limit:g}")
