"""Time records from MATLAB and numpy files: variables force, response and rate_hz (or fs)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy.io

from identification.readers.channel_labels import parse_channels, parse_references
from identification.readers.frf_units import labelled_unit, parse_frf_units
from identification.readers.result_files import write_result_arrays
from identification.words import MAX_INPUT_MAGNITUDE, InputError, Quantity, Real, Records

# Names of variables.
_FORCE_NAME, _RESPONSE_NAME, _SET_POINT_NAME = "force", "response", "set_point"
_RATE_NAMES = ("rate_hz", "fs")
_FRF_NAMES = ("FRFs", "frf")


def holds_time_records(arrays: dict[str, np.ndarray]) -> bool:
    """Return whether the arrays of a file have force and response, and no FRFs."""
    has_records = {_FORCE_NAME, _RESPONSE_NAME} <= arrays.keys()
    return has_records and not any(name in arrays for name in _FRF_NAMES)


def read_array_records(
    path: Path,
    arrays: dict[str, np.ndarray],
    *,
    channels: str | list[str],
    references: list[str],
    quantity: Quantity,
    unit: str | None,
) -> tuple[Records, ...]:
    """Read force (hit, sample), response (hit, channel, sample) and the sampling rate.

    With several references both arrays have the reference as an additional first axis if they were
    driven one after the other; if their forces acted at once, the force alone has it. The axis of
    hits may be missing of a single recording.

    Args:
        arrays: content of the file by name, as ``load_arrays`` reads it.
        channels: ``"nodes 1..23, xyz"`` or a list of labels.
        references: labels of the references.
        quantity: quantity of the resulting FRFs: accelerance if the response is acceleration.
        unit: unit of motion per force, such as ``g/N``; None for SI.

    Returns:
        One ``Records`` for each reference.

    Raises:
        InputError: the arrays contradict channels or references, or the rate is missing.
    """
    outputs, inputs = parse_channels(path, channels), parse_references(path, references)
    force, motion = _numbers(path, arrays, _FORCE_NAME), _numbers(path, arrays, _RESPONSE_NAME)
    rate = _rate(path, arrays)
    n_in, n_out, n_sample = len(inputs), len(outputs), force.shape[-1]
    fits = n_sample > 0 and force.size % (n_in * n_sample) == 0
    hits = force.size // (n_in * n_sample) if fits else 0
    of_references = (n_in,) if n_in > 1 else ()
    axes = (of_references, (hits,) if force.ndim > 1 + len(of_references) else ())
    leading = axes[0] + axes[1]
    at_once = n_in > 1 and motion.ndim < len(leading) + 2
    before = axes[1] if at_once else leading  # axes before the channels
    squeezed = hits == 1 and motion.shape == (
        *before[: len(before) - len(axes[1])],
        n_out,
        n_sample,
    )
    if force.shape != (*leading, n_sample) or not (
        squeezed or motion.shape == (*before, n_out, n_sample)
    ):
        raise InputError(
            f"{path}: {_FORCE_NAME} has shape {force.shape} and {_RESPONSE_NAME} {motion.shape}, "
            f"but {n_in} references and {n_out} channels need {'(reference, ' * (n_in > 1)}"
            f"{'(' * (n_in == 1)}hit, sample) and in addition {n_out} channels before the "
            "samples: correct channels, references or the order of the axes"
        )
    force = force.reshape(n_in, hits, n_sample)
    unit, remarks = labelled_unit(path, arrays, quantity, unit)
    factors = parse_frf_units(path, quantity, unit).factors(outputs, inputs)
    set_points = np.zeros((0, hits, n_sample))
    if _SET_POINT_NAME in arrays:
        given = _numbers(path, arrays, _SET_POINT_NAME)
        if given.size % (hits * n_sample) or given.shape[-1] != n_sample:
            raise InputError(
                f"{path}: {_SET_POINT_NAME} has shape {given.shape}, expected (reference, hit, "
                "sample) as the force has: save it again"
            )
        set_points = given.reshape(-1, hits, n_sample)
    n_set = 1 if at_once else n_in
    motion = np.broadcast_to(
        motion.reshape(n_set, hits, n_out, n_sample), (n_in, hits, n_out, n_sample)
    )
    motion = motion * factors.T[:, None, :, None]
    further = [[n for n in range(n_in) if at_once and n != k] for k in range(n_in)]
    try:
        return tuple(
            Records(
                rate,
                force[k],
                motion[k],
                outputs,
                reference,
                quantity,
                further_forces=force[further[k]],
                set_points=set_points,
                further_references=tuple(inputs[n] for n in further[k]),
                test=path.name,
                remarks=(*_force_remarks(path, arrays), *remarks),
            )
            for k, reference in enumerate(inputs)
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}: save it again") from error


def write_array_records(target: Path, records: Sequence[Records]) -> None:
    """Write force and response of all references of a file, as ``read_array_records`` reads them.

    Args:
        target: .npz or .mat file.
        records: one for each reference, all with as many records.
    """
    arrays = {
        "force": np.stack([record.force for record in records]),
        "response": np.stack([record.motion for record in records]),
    }
    if len(records) == 1:
        arrays = {name: array[0] for name, array in arrays.items()}
    arrays["rate_hz"] = np.array(records[0].rate_hz)
    if target.suffix == ".mat":
        scipy.io.savemat(target, arrays, do_compression=True)
    else:
        write_result_arrays(target, arrays)


def _force_remarks(path: Path, arrays: dict[str, np.ndarray]) -> tuple[str, ...]:
    """Return a remark if only the order of columns says which one is the force."""
    if "force_label" not in arrays:
        return ()
    return (
        f"{path.name}: its first column, {arrays['force_label']}, counts as the force, since no "
        "heading or unit names one alone: state columns in its [[test]], the force first"
        if np.ndim(arrays["force"]) == 2
        else f"{path.name}: its first columns, {arrays['force_label']}, count as the forces, since "
        "headings and units name others: state columns in its [[test]], the forces first",
    )


def _numbers(path: Path, arrays: dict[str, np.ndarray], name: str) -> Real:
    """Return a variable as real numbers."""
    if name not in arrays:
        raise InputError(f"{path} has no variable {name!r}: save it under that name")
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiu" or values.ndim == 0:
        raise InputError(f"{path}: {name} is not an array of real numbers: save it as one")
    is_usable = np.abs(values) <= MAX_INPUT_MAGNITUDE  # false for NaN
    if not is_usable.all():
        first = ", ".join(map(str, np.argwhere(~is_usable)[0].tolist()))
        raise InputError(
            f"{path}: {name} holds NaN or values beyond {MAX_INPUT_MAGNITUDE:g}, first at [{first}]"
            " counted from 0: save it again, or leave that record out"
        )
    return values.astype(np.float64)


def _rate(path: Path, arrays: dict[str, np.ndarray]) -> float:
    """Return the sampling rate [Hz]."""
    name = next((name for name in _RATE_NAMES if name in arrays), None)
    if name is None:
        raise InputError(f"{path} has no sampling rate: save rate_hz, samples per second")
    values = _numbers(path, {name: np.atleast_1d(arrays[name])}, name)
    if values.size != 1 or not np.isfinite(values).all() or values.min() <= 0:
        raise InputError(
            f"{path}: {name} is not a sampling rate: save samples per second, one number"
        )
    return float(values.ravel()[0])
