"""Arrays of text files, under the names that .npz files have: FRFs, or force and response.

Headings say what the columns are: ``re`` and ``im``, ``mag`` and ``phase`` (in degrees unless they
say rad), ``coherence``; without one a column holds complex FRFs.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.readers.labview_text import read_labview_text
from identification.readers.text_tables import TextTable, name_words, read_text_table
from identification.readers.units import FREQUENCY_UNITS_HZ, TIME_UNITS_S, is_unit_label
from identification.words import Complex, InputError, Real, shorten_names

_FRF_PARTS = {
    "real": {"re", "real"},
    "imaginary": {"im", "imag", "imaginary"},
    "magnitude": {"mag", "magnitude", "abs", "amplitude"},
    "phase": {"phase", "angle"},
    "coherence": {"coh", "coherence"},
}
_DECIBELS = {"db", "decibel", "decibels"}
_TIME_WORDS = {"time", "t"}
_FREQUENCY_WORDS = {"frequency", "freq", "hz", "khz"}
_FORCE_WORDS, _FORCE_UNITS = {"force", "hammer"}, {"n", "newton", "lbf"}
_MAX_TIME_STEP_SPREAD = 1e-2  # relative: what six printed digits leave of steps of a long record
_FLOAT_ERROR = 1e-9  # relative: of the step of times in double precision
_RATES_HZ = (0.01, 1e9)  # of records of machines; others are times in another unit

_UNIT_IN_BRACKETS = re.compile(r"[\[(]([^\[\]()]{1,20})[\])]\s*$")

Arrays = dict[str, np.ndarray]


def read_text_arrays(
    path: Path, columns: Sequence[int | str] | None = None, forces: int = 1
) -> Arrays:
    """Read ``frf``, ``coherence``, ``freq_hz``, or ``force``, ``response``, ``rate_hz``.

    FRFs have the shape (freq, column), force (hit, sample) or, of several forces at once, (force,
    hit, sample), and response (hit, channel, sample).
    ``unit_label`` is the unit of motion over force in the headings, empty without one,
    ``freq_label`` the unit in the heading of the frequencies. ``force_label`` is there if the
    force is only supposed to be one, and holds its heading.

    Args:
        path: .csv, .txt, .dat or .lvm.
        columns: headings or numbers, from 1, of the columns beside frequency or time; None for all.
            The first ones of time records are the forces.
        forces: number of forces that act at once in time records, in the order of references.

    Raises:
        InputError: the file is no table of FRFs or of time records.
    """
    is_labview = path.suffix.lower() == ".lvm"
    tables = read_labview_text(path) if is_labview else (read_text_table(path),)
    chosen = [table if columns is None else choose_columns(table, columns) for table in tables]
    axis_words = name_words(tables[0].axis_name)
    if axis_words & _TIME_WORDS and not axis_words & _FREQUENCY_WORDS:
        return _records(chosen, forces, is_force_stated=columns is not None)
    if len(chosen) > 1:
        raise InputError(f"{path} holds {len(chosen)} sections of FRFs: export one to a file")
    return _frfs(chosen[0])


def choose_columns(table: TextTable, columns: Sequence[int | str]) -> TextTable:
    """Return the columns of a table that campaign.toml names, in its order."""
    places: list[int] = []
    for column in columns:
        if isinstance(column, int):
            fitting = [column - 1] if 1 <= column <= len(table.names) else []
        else:
            bare = [{name, name.split(" [")[0]} for name in table.names]
            if not any(column in texts for texts in bare):  # a row of units gave the last word
                bare = [{name.rpartition(" ")[0]} for name in table.names]
            fitting = [k for k, texts in enumerate(bare) if column in texts]
        if len(fitting) != 1:
            count = "no column" if not fitting else f"{len(fitting)} columns"
            headings = [name or k for k, name in enumerate(table.names, start=1)]
            raise InputError(
                f"{table.path} has {count} {column!r} beside {table.axis_name or 'the first'} "
                f"(there are {shorten_names(headings)}): correct columns in campaign.toml"
            )
        places += fitting
    names = tuple(table.names[place] for place in places)
    return replace(table, names=names, values=table.values[:, places])


def _records(tables: Sequence[TextTable], forces: int, *, is_force_stated: bool) -> Arrays:
    """Return forces, response and rate of time records; each table is one record."""
    first = tables[0]
    shapes = {table.values.shape for table in tables}
    if len(shapes) > 1 or first.values.shape[1] <= forces or len(first.axis) < 2:
        raise InputError(
            f"{first.path}: its sections have the shapes {shorten_names(sorted(shapes))} (samples, "
            "channels): export force and responses of equal length, two samples at least"
        )
    rates = [find_rate(table) for table in tables]
    if max(rates) - min(rates) > _MAX_TIME_STEP_SPREAD * max(rates):
        raise InputError(f"{first.path}: its sections have different rates: export one rate a file")
    values = np.array([table.values.T for table in tables])
    if values.imag.any():
        raise InputError(f"{first.path}: its time records are complex: export real numbers")
    named = [
        k
        for k, name in enumerate(first.names)
        if name_words(name) & _FORCE_WORDS or _unit(name).lower() in _FORCE_UNITS
    ]
    is_named = len(named) == forces and not is_force_stated
    places = named if is_named else list(range(forces))
    force = values.real[:, places].swapaxes(0, 1)
    arrays = {
        "force": force if forces > 1 else force[0],
        "response": np.delete(values.real, places, axis=1),
        "rate_hz": np.array(rates[0]),
        "unit_label": np.array(find_motion_unit(first.names, places)),
    }
    if not is_named and not is_force_stated:
        arrays["force_label"] = np.array(" and ".join(first.names[k] or str(k + 1) for k in places))
    return arrays


def find_rate(table: TextTable, unit: str | None = None) -> float:
    """Return the samples per second of a record, whose times are in the unit of their heading.

    Args:
        table: columns over time.
        unit: that of the times, where it is stated; else that at the end of their heading, else s.

    Raises:
        InputError: times that are not evenly spaced, are whole numbers of no unit, or give a rate
            that no record has.
    """
    return rate_of_times(table.path, table.axis_name, table.axis, unit)


def rate_of_times(path: Path, heading: str, times: Real, unit: str | None = None) -> float:
    """Return the samples per second of a record, by the heading and the times of its clock.

    Args:
        path: file.
        heading: of the times.
        times: of the samples; (n_sample,).
        unit: as for ``find_rate``.

    Raises:
        InputError: as for ``find_rate``.
    """
    *_, last = ["", *re.findall(r"[^\W\d_]+", heading.lower())]
    is_known = (unit or last) in TIME_UNITS_S
    if not is_known and len(times) > 1 and (times == np.round(times)).all():
        raise InputError(
            f"{path}: its times are whole numbers without a unit: head them with it, as in "
            'Time [ms], or state time_unit = "ms" or "s" under [log]'
        )
    return read_rate(path, times, TIME_UNITS_S.get(unit or last, 1.0))


def read_rate(path: Path, times: Real, unit_s: float) -> float:
    """Return the samples per second by the times of samples, rounded as their digits allow.

    Args:
        times: of the samples; (n_sample,).
        unit_s: unit of the times [s].

    Raises:
        InputError: they are not evenly spaced, or give a rate that no record has.
    """
    steps = np.diff(times) * unit_s
    mean = float(steps.mean()) if len(steps) else 0.0
    if mean <= 0 or np.abs(steps - mean).max() > _MAX_TIME_STEP_SPREAD * mean:
        spread = ""
        if len(steps):
            worst = int(np.abs(steps - np.median(steps)).argmax())
            spread = (
                f", {steps.min():g} to {steps.max():g} s (step {worst + 1}, after the time "
                f"{times[worst]:g}, is the oddest of {len(steps)})"
            )
        raise InputError(
            f"{path}: its times are not evenly spaced{spread}: export samples of one rate, or the "
            "longest part without a gap"
        )
    if not _RATES_HZ[0] <= 1 / mean <= _RATES_HZ[1]:
        raise InputError(
            f"{path}: its times give {1 / mean:.3g} samples per second: head them with their unit, "
            'such as ms, or state time_unit = "ms" under [log]'
        )
    # Printed digits leave an error of the last time, by which files of one rate would differ.
    error = float(np.abs(steps - mean).max()) / (len(steps) * mean) + _FLOAT_ERROR
    rounded = (round(1 / mean, digits) for digits in range(3))
    return next((rate for rate in rounded if abs(rate * mean - 1) <= error), 1 / mean)


def _frfs(table: TextTable) -> Arrays:
    """Return FRFs, coherence and frequencies of a table."""
    parts = [_part(table.path, name) for name in table.names]
    columns = {part: table.values[:, [p == part for p in parts]] for part in ("", *_FRF_PARTS)}
    values = _complex_values(table, columns)
    units = {
        _unit(name)
        for name, part in zip(table.names, parts, strict=True)
        if part not in {"phase", "coherence"}
    }
    arrays: Arrays = {
        "frf": values,
        "freq_hz": table.axis,
        "unit_label": np.array(", ".join(sorted(unit for unit in units if "/" in unit))),
        "freq_label": np.array(_unit_at_end(table.axis_name)),
    }
    if "coherence" in parts:
        arrays["coherence"] = _real(table.path, columns["coherence"])
    return arrays


def _complex_values(table: TextTable, columns: dict[str, Complex]) -> Complex | Real:
    """Return the FRFs of complex columns, or of pairs; real columns without a part stay real."""
    count = {part: columns[part].shape[1] for part in columns}
    pair = next((p for p in (("real", "imaginary"), ("magnitude", "phase")) if count[p[0]]), None)
    used = sum(count.values()) - count["coherence"]
    if pair is None and used == count[""] > 0:
        plain = columns[""]
        return plain if plain.imag.any() else plain.real
    if pair is None or count[pair[0]] != count[pair[1]] or used != 2 * count[pair[0]]:
        held = ", ".join(f"{n} of {part or 'no part'}" for part, n in count.items() if n)
        raise InputError(
            f"{table.path}: its headings name columns {held}: give re and im, or mag and phase, of "
            "each FRF, or complex columns alone"
        )
    first, second = (_real(table.path, columns[part]) for part in pair)
    if pair[0] == "real":
        return first + 1j * second
    phases = [name for name in table.names if name_words(name) & _FRF_PARTS["phase"]]
    in_rad = np.array([bool({"rad", "radian", "radians"} & name_words(n)) for n in phases])
    return first * np.exp(1j * np.where(in_rad, second, np.radians(second)))


def fold_columns(path: Path, arrays: Arrays, shape: tuple[int, int, int]) -> list[str]:
    """Give FRFs and coherence of a text file the axes (freq, out, in); return remarks.

    The columns hold all channels of the first reference, then those of the next. Twice as many real
    columns are pairs of real and imaginary parts, if the first of each is negative somewhere, as a
    magnitude never is.

    Args:
        arrays: content of the file, which is changed.
        shape: numbers of frequencies, channels and references.
    """
    lines, n_out, n_in = shape
    values, remarks = arrays["frf"], []
    if values.shape[1] == 2 * n_out * n_in and values.dtype.kind == "f":
        if not (values[:, ::2] < 0).any(axis=0).all():
            raise InputError(
                f"{path}: its {values.shape[1]} real columns are parts of {n_out * n_in} FRFs "
                "without a name: add a header line with re and im, or mag and phase"
            )
        arrays["frf"] = values[:, ::2] + 1j * values[:, 1::2]
        remarks = [
            f"{path.name}: its columns have no headings re and im, and count as real and imaginary "
            "parts in turn"
        ]
    for name, what in (("frf", "FRFs"), ("coherence", "coherences")):
        if name not in arrays:
            continue
        count = arrays[name].shape[1]
        if count != n_out * n_in:
            raise InputError(
                f"{path} has columns of {count} {what}, but {n_out} channels and {n_in} references "
                f"need {n_out * n_in}: correct channels or references, or choose columns in its "
                "[[test]]"
            )
        arrays[name] = arrays[name].reshape(lines, n_in, n_out).swapaxes(1, 2)
    return remarks


def _unit(name: str) -> str:
    """Return the unit in brackets at the end of a heading such as ``acc 1 [g]``; empty without."""
    match = _UNIT_IN_BRACKETS.search(name)
    return match.group(1).strip() if match else ""


def find_motion_unit(names: Sequence[str], forces: Sequence[int]) -> str:
    """Return the unit of motion over force of time records; empty if no heading has one.

    Units stand in brackets, or as the last words of all headings, as where a row of units follows.

    Args:
        names: headings of all columns.
        forces: columns of the forces.
    """
    labels = [_unit(name) for name in names]
    last = [name.rpartition(" ")[2] for name in names]
    if not any(labels) and all(map(is_unit_label, last)):
        labels = last
    motions = sorted({label for k, label in enumerate(labels) if k not in forces})
    driven = sorted({labels[k] for k in forces})
    units = [" and ".join(unit or "no unit" for unit in each) for each in (motions, driven)]
    return "" if set(units) == {"no unit"} else "/".join(units)


def _unit_at_end(name: str) -> str:
    """Return the unit of frequency at the end of a heading such as ``Frequency [Hz]``; or empty."""
    text = name.rstrip(" )]").lower()
    units = [unit for unit in FREQUENCY_UNITS_HZ if text.endswith(unit.lower())]
    return max(units, key=len, default="")


def _part(path: Path, name: str) -> str:
    """Return which part of an FRF a column holds by its heading; empty for all of it."""
    words = name_words(name)
    parts = [part for part, known in _FRF_PARTS.items() if known & words]
    if len(parts) > 1 or words & _DECIBELS:
        raise InputError(
            f"{path}: the heading {name!r} names {' and '.join(parts) or 'decibels'}: export real "
            "and imaginary parts, with headings re and im"
        )
    return parts[0] if parts else ""


def _real(path: Path, values: Complex) -> Real:
    """Return real numbers, unless one is complex."""
    if values.imag.any():
        raise InputError(
            f"{path}: a column with the heading of a part or coherence holds complex numbers: "
            "correct the heading"
        )
    return np.array(values.real)
