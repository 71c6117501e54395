"""Time records from MATLAB and numpy files: force, response and rate_hz (or fs)."""

from pathlib import Path

import numpy as np

from identification.readers.array_frfs import parse_channels, unit_factor
from identification.words import InputError, Quantity, Real, Records

_FORCE, _RESPONSE = "force", "response"
_RATES = ("rate_hz", "fs")
_FRFS = ("FRFs", "frf")


def are_records(arrays: dict[str, np.ndarray]) -> bool:
    """Whether the arrays of a file have force and response, and no FRF."""
    return {_FORCE, _RESPONSE} <= arrays.keys() and not any(name in arrays for name in _FRFS)


def read_array_records(
    path: Path,
    arrays: dict[str, np.ndarray],
    *,
    channels: str | list[str],
    references: list[str],
    quantity: Quantity,
    unit: str | None,
) -> tuple[Records, ...]:
    """Read force (hit, sample), response (hit, channel, sample) and the rate.

    With several references both have one more axis before the others. One recording of many hits
    may be (sample,) and (channel, sample).

    Args:
        path: the file.
        arrays: its content by name, as ``load_arrays`` reads it.
        channels: ``"nodes 1..23, xyz"`` or a list of labels.
        references: labels.
        quantity: of the FRFs: accelerance of accelerations.
        unit: of motion per force, such as ``g/N``; None for SI.

    Returns:
        One ``Records`` for each reference.

    Raises:
        InputError: with the file and what does not fit.
    """
    outputs, inputs = parse_channels(path, channels), parse_channels(path, references)
    force, motion = _numbers(path, arrays, _FORCE), _numbers(path, arrays, _RESPONSE)
    rate = _rate(path, arrays)
    n_in, n_out, n_sample = len(inputs), len(outputs), force.shape[-1]
    fits = n_sample > 0 and force.size % (n_in * n_sample) == 0
    hits = force.size // (n_in * n_sample) if fits else 0
    axes = (((n_in,) if n_in > 1 else ()), ((hits,) if force.ndim > 1 else ()))
    before = axes[0] + axes[1]
    squeezed = hits == 1 and motion.shape == (*axes[0], n_out, n_sample)
    if force.shape != (*before, n_sample) or not (
        squeezed or motion.shape == (*before, n_out, n_sample)
    ):
        raise InputError(
            f"{path}: {_FORCE} has shape {force.shape} and {_RESPONSE} {motion.shape}; with "
            f"{n_in} references and {n_out} channels they are {'(reference, ' * (n_in > 1)}"
            f"{'(' * (n_in == 1)}hit, sample) and the same with {n_out} channels before the "
            "samples: mend channels, references or the order of the axes"
        )
    force = force.reshape(n_in, hits, n_sample)
    motion = motion.reshape(n_in, hits, n_out, n_sample) * unit_factor(path, quantity, unit)
    try:
        return tuple(
            Records(rate, force[k], motion[k], outputs, reference, quantity, test=path.name)
            for k, reference in enumerate(inputs)
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}: save it again") from error


def _numbers(path: Path, arrays: dict[str, np.ndarray], name: str) -> Real:
    if name not in arrays:
        raise InputError(f"{path} has no variable {name!r}: save it under that name")
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiu" or values.ndim == 0:
        raise InputError(f"{path}: {name} holds no real numbers: save an array of them")
    return values.astype(np.float64)


def _rate(path: Path, arrays: dict[str, np.ndarray]) -> float:
    found = [name for name in _RATES if name in arrays]
    if not found:
        raise InputError(f"{path} does not say its rate: save rate_hz, samples per second")
    values = _numbers(path, {found[0]: np.atleast_1d(arrays[found[0]])}, found[0])
    if values.size != 1 or not np.isfinite(values).all() or values.min() <= 0:
        raise InputError(f"{path}: {found[0]} is no rate: save samples per second, one number")
    return float(values.ravel()[0])
