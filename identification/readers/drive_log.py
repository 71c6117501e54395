"""Records of a controller or drive: columns that are motors, encoders and references, by name.

Messages of an MCAP file come when they come. All signals are brought to one time base: evenly, as
fast as the slowest of their topics in the median.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import scipy.fft
import scipy.ndimage
from scipy.interpolate import make_interp_spline

from identification.readers.array_files import is_text, load_arrays
from identification.readers.child_process import read_in_child
from identification.readers.log_toml import LogSettings
from identification.readers.text_arrays import (
    Arrays,
    choose_columns,
    find_motion_unit,
    find_rate,
    rate_of_times,
)
from identification.readers.text_tables import read_text_table
from identification.readers.units import TIME_UNITS_S
from identification.words import Controller, InputError, Real, shorten_names
from identification.words.file_access import check_file

_TIME_NAMES = ("time", "t", "tout")  # the last one is Simulink's
_HAS_HEADING = re.compile(r"[\s\[(]")  # of a name with a unit
_LOG_RATES = ("rate_hz", "fs")
_CHILDREN = {
    ".h5": "matlab73_child.py",
    ".hdf5": "matlab73_child.py",
    ".parquet": "parquet_child.py",
    ".mcap": "mcap_child.py",
}
# Part of the intervals between messages that may be longer than twice the usual one.
_MAX_LATE_MESSAGES = 0.01
_FASTER, _PASSED, _TAPS = 1.2, 0.9, 16  # ratio of rates, part that passes, taps for each sample
_DEGREE = 7  # of splines between messages
_ROUNDING = 1e-4  # of a step, by which times of messages may miss the last one
_MAX_PERIOD_ERROR = 0.01  # of the period of a controller, by the clock of its record


def read_drive_log(
    path: Path, log: LogSettings, controllers: Mapping[str, Controller] | None = None
) -> Arrays:
    """Read ``force``, ``response``, ``set_point`` and ``rate_hz`` of a record over time.

    A text table has a column of time; a .mat, .npz, .h5 or .parquet file has a variable for each
    signal, and ``time`` or ``rate_hz``. In an .mcap file a signal is a field of a topic.

    Args:
        log: its columns.
        controllers: stated controller of each motor, from which ``set_point`` follows.

    Returns:
        Motors (motor, realisation, sample), encoders (realisation, encoder, sample) and references
        (reference, realisation, sample), without an axis of one motor or realisation; and the unit
        of the headings of a table.

    Raises:
        InputError: the file cannot be read, has no such column, or is too short.
    """
    columns, unit = [*log.motors.values(), *log.encoders.values(), *log.references], ""
    if is_text(path):
        table = choose_columns(read_text_table(path), columns)
        if np.iscomplexobj(table.values) and table.values.imag.any():
            raise InputError(f"{path}: its columns are complex: export the record over time")
        signals, rate = table.values.real.T, find_rate(table, log.time_unit)
        driven = table.names[: len(log.motors) + len(log.encoders)]
        unit = find_motion_unit(driven, range(len(log.motors)))
    else:
        signals, rate, names = _read_variables(path, columns, log.time_unit)
        headings = [name if _HAS_HEADING.search(name) else "" for name in names]
        driven = tuple(headings[: len(log.motors) + len(log.encoders)])
        unit = find_motion_unit(driven, range(len(log.motors)))
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
        "unit_label": np.array(unit),
    }
    if log.references:
        arrays["set_point"] = signals[n_in + n_out :]
    if controllers:
        _refuse_unusable(path, controllers, rate)
        arrays["set_point"] = _find_set_points(log, controllers, force, response, rate)
    return arrays


def _refuse_unusable(path: Path, controllers: Mapping[str, Controller], rate_hz: float) -> None:
    """Refuse controllers that no loop of this record has."""
    for motor, controller in controllers.items():
        period = controller.period_s
        if controller.poles.real.max(initial=0.0) > _ROUNDING * rate_hz:
            raise InputError(
                f"{path}: the controller of {motor} has a pole that grows: correct its poles, or "
                "add period if they are in z"
            )
        if period and abs(period * rate_hz - 1) > _MAX_PERIOD_ERROR:
            raise InputError(
                f"{path}: the controller of {motor} has a period of {period:g} s, and the record "
                f"a sample each {1 / rate_hz:.6g} s: state both at one rate"
            )


def _find_set_points(
    log: LogSettings,
    controllers: Mapping[str, Controller],
    force: Real,
    response: Real,
    rate_hz: float,
) -> Real:
    r"""Return what commands hold beside the feedback of the encoders; (n_motor, .., n_sample).

    The command u = K(s) exp(-s tau) (r - y) holds the noise of y through K alone, so that

        u + K(s) exp(-s tau) y = K(s) exp(-s tau) r

    is independent of it, an instrument like a recorded reference (indirect identification;
    Soderstrom and Stoica 1989, ch. 10). Sampled controllers act by K(z), without the hold that
    follows them. A motor without a stated controller has no feedback.

    Args:
        log: names of motors and encoders, and delays tau.
        controllers: K of each motor.
        force: u; (n_motor, .., n_sample).
        response: y; (n_encoder, .., n_sample).
    """
    external, count = np.array(force), 2 * force.shape[-1]  # zeros behind: K may ring
    laplace = 2j * np.pi * scipy.fft.rfftfreq(count, 1 / rate_hz)[1:]  # a constant tells nothing
    for row, motor in enumerate(log.motors):
        if motor not in controllers:
            continue
        controller, table = controllers[motor], log.controllers[motor]
        gain = np.exp(-laplace * table.delay) * (
            controller.sampled_response(laplace)
            if controller.period_s
            else controller.response(laplace)
        )
        motion = response[list(log.encoders).index(table.encoder)]
        spectrum = scipy.fft.rfft(motion - motion.mean(axis=-1, keepdims=True), count)
        gain[-1] = 0.0  # half the rate, where a pole at z = -1 has no value
        spectrum = np.concatenate([np.zeros_like(spectrum[..., :1]), gain * spectrum[..., 1:]], -1)
        external[row] += scipy.fft.irfft(spectrum, count)[..., : force.shape[-1]]
    return external


def _read_variables(
    path: Path, columns: Sequence[int | str], time_unit: str | None
) -> tuple[Real, float, list[str]]:
    """Return signals (n_signal, n_sample) of an array file, samples per second, and their names."""
    arrays = _split_columns(_load(path))
    names = [_find_name(path, arrays, column) for column in columns]
    signals = [_vector(path, arrays, name) for name in names]
    if path.suffix.lower() == ".mcap":
        topics = [_find_times(arrays, name) for name in names]
        return *_bring_together(path, names, topics, signals), names
    # In a group of HDF5 or a structure the clock may lie beside the signals, or above them.
    prefixes = {"": None}
    for name in sorted(names):
        parts = name.split("/")[:-1]
        prefixes |= {"".join(f"{part}/" for part in parts[:k]): None for k in range(len(parts) + 1)}
    beside = {
        name: name.removeprefix(prefix).lower()
        for prefix in sorted(prefixes, key=lambda text: -text.count("/"))
        for name in arrays
        if name.startswith(prefix) and "/" not in name.removeprefix(prefix)
    }
    time = next((n for n, bare in beside.items() if n not in names and _is_clock(bare)), None)
    rate = next((n for n, bare in beside.items() if bare in _LOG_RATES), None)
    times = signals[0] if time is None else _vector(path, arrays, time)
    if len({*map(len, signals), len(times)}) > 1:
        raise InputError(f"{path}: its signals and times have different lengths: export one record")
    if rate is not None:
        return np.array(signals), float(_vector(path, arrays, rate)[0]), names
    if time is None:
        raise InputError(
            f"{path} has no sampling rate: save time, or rate_hz, samples per second, beside them"
        )
    heading = time.rpartition("/")[2]
    return np.array(signals), rate_of_times(path, heading, times, time_unit), names


def _split_columns(arrays: Arrays) -> Arrays:
    """Return the variables, and each column of a matrix under its number, as ``yout(2)``."""
    columns = {
        f"{name}({number})": values[:, number - 1]
        for name, values in arrays.items()
        if values.ndim == 2 and 1 < values.shape[1] < values.shape[0]
        for number in range(1, values.shape[1] + 1)
    }
    return {**columns, **arrays}


def _find_name(path: Path, arrays: Arrays, column: int | str) -> str:
    """Return the variable that a campaign means: by its name, with dots, or without its unit."""
    text = str(column)
    plain = text.replace("(:,", "(").replace(".", "/")
    names = [name for name in (text, plain) if name in arrays]
    names = names or [name for name in arrays if name.split(" [")[0] == text]
    if not names or not isinstance(column, str):
        raise InputError(
            f"{path} has no variable {column!r} (there are {shorten_names(sorted(arrays))}): "
            "correct its name under [log]"
        )
    return names[0]


def _is_clock(name: str) -> bool:
    """Return whether a name is that of times, perhaps with a unit: ``time``, ``Time [ms]``."""
    first, *further = re.findall(r"[^\W\d_]+", name.lower()) or [""]
    return first in _TIME_NAMES and all(word in TIME_UNITS_S for word in further)


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


def _find_times(arrays: Arrays, column: str) -> Real:
    """Return the times of the messages that hold a signal [s]; (n_message,)."""
    names = (name for name in arrays if name.endswith(":time") and column.startswith(name[:-5]))
    return np.asarray(arrays[max(names, key=len)], float)


def _bring_together(
    path: Path, names: Sequence[str], times: Sequence[Real], signals: Sequence[Real]
) -> tuple[Real, float]:
    """Return the signals of topics on the time base of the slowest one, and its rate.

    A faster topic loses by a low-pass what the slower base cannot show. Between messages a spline
    of degree 7 follows: half a sample beside them it is right to 0.1 % up to 0.5 of the highest
    frequency, and 8 % too low at 0.8 of it (Unser 1999).

    Args:
        names: of the signals.
        times: of their messages [s].
        signals: their values.

    Raises:
        InputError: messages are missing, late or without a clock.
    """
    steps = [float(np.median(np.diff(time))) if len(time) > 1 else 0.0 for time in times]
    for name, time, step in zip(names, times, steps, strict=True):
        if step <= 0 or (np.diff(time) <= 0).any():
            raise InputError(
                f"{path}: messages of {name} are few, or have equal or falling times: record "
                "stamps that rise"
            )
        if np.mean(np.diff(time) > 2 * step) > _MAX_LATE_MESSAGES:
            raise InputError(
                f"{path}: messages of {name} are missing or late, up to {np.diff(time).max():.3g} "
                f"s apart where {step:.3g} s are usual: record on the controller itself, or with "
                "less load"
            )
    first, last, step = max(t[0] for t in times), min(t[-1] for t in times), max(steps)
    base = np.arange(first, last + _ROUNDING * step, step)
    if len(base) <= _DEGREE:
        raise InputError(
            f"{path}: the topics of {', '.join(names)} have hardly any time in common: record them "
            "together, by one clock"
        )
    together = []
    for time, signal, spacing in zip(times, signals, steps, strict=True):
        ratio, passed = step / spacing, signal
        if ratio > _FASTER:
            from scipy.signal import firwin  # noqa: PLC0415  # slow to load

            taps = firwin(2 * round(_TAPS * ratio) + 1, _PASSED / ratio)
            passed = scipy.ndimage.convolve1d(signal, taps, mode="nearest")
        together.append(make_interp_spline(time, passed, _DEGREE)(base))
    return np.array(together), 1 / step


def _vector(path: Path, arrays: Arrays, name: str) -> Real:
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiu" or values.size != max(values.shape, default=1):
        raise InputError(f"{path}: {name} is no row of real numbers: save one signal under it")
    return values.astype(np.float64).ravel()
