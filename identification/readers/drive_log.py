"""Records of a controller or drive: columns that are motors, encoders and references, by name.

Messages of an MCAP file come when they come. All signals are brought to one time base: evenly, as
fast as the slowest of their topics in the median, linear between messages.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.readers.array_files import is_text, load_arrays
from identification.readers.campaign_toml import LogSettings
from identification.readers.child_process import read_in_child
from identification.readers.text_arrays import Arrays, choose_columns, find_rate
from identification.readers.text_tables import read_text_table
from identification.words import InputError, Real
from identification.words.file_access import check_file

_TIME_NAMES = ("time", "t")
_LOG_RATES = ("rate_hz", "fs")
_CHILDREN = {
    ".h5": "matlab73_child.py",
    ".hdf5": "matlab73_child.py",
    ".parquet": "parquet_child.py",
    ".mcap": "mcap_child.py",
}
# Part of the intervals between messages that may be longer than twice the usual one.
_MAX_LATE_MESSAGES = 0.01
_ROUNDING = 1e-4  # of a step, by which times of messages may miss the last one


def read_drive_log(path: Path, log: LogSettings) -> Arrays:
    """Read ``force``, ``response``, ``set_point`` and ``rate_hz`` of a record over time.

    A text table has a column of time; a .mat, .npz, .h5 or .parquet file has a variable for each
    signal, and ``time`` or ``rate_hz``. In an .mcap file a signal is a field of a topic.

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
    arrays = _load(path)
    if path.suffix.lower() == ".mcap":
        arrays = _resample(path, arrays, [str(column) for column in columns])
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


def _load(path: Path) -> Arrays:
    """Return the variables of an array file, or of a file of logged columns or messages."""
    script = _CHILDREN.get(path.suffix.lower())
    if script is None:
        return load_arrays(path)
    check_file(path, "name the record under [log]")
    try:
        return read_in_child(Path(__file__).with_name(script), path)
    except ValueError as error:
        way_out = "save it again"
        if "No module named" in str(error):
            way_out = "install what reads it by pip install 'mbworkbench[logs]'"
        raise InputError(f"{path} cannot be read ({error}): {way_out}") from error


def _resample(path: Path, arrays: Arrays, columns: Sequence[str]) -> Arrays:
    """Return the signals of topics on the time base of the slowest one, with ``time``."""
    times = {}
    for column in filter(arrays.__contains__, columns):
        topic = max(
            (name for name in arrays if name.endswith(":time") and column.startswith(name[:-5])),
            key=len,
        )
        times[column] = arrays[topic]
    if not times or min(map(len, times.values())) < 2:
        return arrays
    steps = {column: float(np.median(np.diff(time))) for column, time in times.items()}
    for column, time in times.items():
        intervals = np.diff(time)
        if steps[column] <= 0 or np.mean(intervals > 2 * steps[column]) > _MAX_LATE_MESSAGES:
            raise InputError(
                f"{path}: messages of {column} are missing or late, up to "
                f"{intervals.max():.3g} s apart where {steps[column]:.3g} s are usual: record on "
                "the controller itself, or with less load"
            )
    first, last = max(t[0] for t in times.values()), min(t[-1] for t in times.values())
    step = max(steps.values())
    base = np.arange(first, last + _ROUNDING * step, step)
    return {
        "time": base - first,
        **{column: np.interp(base, time, arrays[column]) for column, time in times.items()},
    }


def _vector(path: Path, arrays: Arrays, name: str) -> Real:
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiu" or values.size != max(values.shape, default=1):
        raise InputError(f"{path}: {name} is no row of real numbers: save one signal under it")
    return values.astype(np.float64).ravel()
