"""Records of a controller or drive: columns that are motors, encoders and references, by name."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.readers.array_files import is_text, load_arrays
from identification.readers.campaign_toml import LogSettings
from identification.readers.text_arrays import Arrays, choose_columns, find_rate
from identification.readers.text_tables import read_text_table
from identification.words import InputError, Real

_TIME_NAMES = ("time", "t")
_LOG_RATES = ("rate_hz", "fs")


def read_drive_log(path: Path, log: LogSettings) -> Arrays:
    """Read ``force``, ``response``, ``set_point`` and ``rate_hz`` of a record over time.

    A text table has a column of time; a .mat or .npz file has a variable for each signal, and
    ``time`` or ``rate_hz``.

    Args:
        path: the file.
        log: its columns.

    Returns:
        Motors (motor, realisation, sample), encoders (realisation, encoder, sample) and references
        (reference, realisation, sample), without an axis of one motor or realisation.

    Raises:
        InputError: the file cannot be read, has no such column, or is too short.
    """
    columns = [*log.motors.values(), *log.encoders.values(), *log.references]
    if is_text(path):
        table = choose_columns(read_text_table(path), columns)
        if np.iscomplexobj(table.values) and table.values.imag.any():
            raise InputError(f"{path}: its columns are complex: export the record over time")
        signals, rate = table.values.real.T, find_rate(table)
    else:
        signals, rate = _read_variables(path, columns)
    n_in, n_out = len(log.motors), len(log.encoders)
    if (count := log.realisations) > 1:
        length = signals.shape[1] // count
        if not length:
            raise InputError(
                f"{path}: {signals.shape[1]} samples are no {count} realisations: correct "
                "realisations under [log]"
            )
        signals = signals[:, : count * length].reshape(-1, count, length)
    force, response = signals[:n_in], signals[n_in : n_in + n_out]
    arrays = {
        "force": force if n_in > 1 else force[0],
        "response": response if count == 1 else response.swapaxes(0, 1),
        "rate_hz": np.array(rate),
    }
    if log.references:
        arrays["set_point"] = signals[n_in + n_out :]
    return arrays


def _read_variables(path: Path, columns: Sequence[int | str]) -> tuple[Real, float]:
    """Return signals (n_signal, n_sample) of an array file, and samples per second."""
    arrays = load_arrays(path)
    signals = []
    for column in columns:
        if column not in arrays:
            raise InputError(
                f"{path} has no variable {column!r} (there are {', '.join(sorted(arrays))}): "
                "correct its name under [log]"
            )
        signals.append(_vector(path, arrays, str(column)))
    if len({len(signal) for signal in signals}) > 1:
        raise InputError(f"{path}: its signals have different lengths: export one record")
    for name in _LOG_RATES:
        if name in arrays:
            return np.array(signals), float(_vector(path, arrays, name)[0])
    for name in _TIME_NAMES:
        if name in arrays:
            steps = np.diff(_vector(path, arrays, name))
            if len(steps) and (np.abs(steps - steps.mean()) <= 0.01 * abs(steps.mean())).all():
                return np.array(signals), 1 / float(steps.mean())
            raise InputError(f"{path}: {name} is not evenly spaced: export samples of one rate")
    raise InputError(f"{path} has no sampling rate: save time, or rate_hz, samples per second")


def _vector(path: Path, arrays: Arrays, name: str) -> Real:
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiu" or values.size != max(values.shape, default=1):
        raise InputError(f"{path}: {name} is no row of real numbers: save one signal under it")
    return values.astype(np.float64).ravel()
