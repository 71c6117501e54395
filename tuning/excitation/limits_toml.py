"""Limits of drives and noise of sensors from a TOML file, and from texts of the command line."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import Field

from identification.readers.toml_files import TomlTable, read_toml, table_of
from identification.words import InputError, UsageError
from tuning.excitation.limits import DriveLimits
from tuning.excitation.request import ExcitationOptions

_LIMIT_NAMES = ("force", "current", "stroke", "speed", "motor_constant")


class DriveTable(
    table_of(  # type: ignore[misc]
        DriveLimits, lambda name: {} if name == "at" else {"gt": 0}
    )
):
    """Limits of one ``[drive.<name>]``, in SI; ``at`` is where stroke and speed are read."""


class SensorTable(TomlTable):
    """Noise of one ``[sensor.<name>]``: a density, or the step of an encoder."""

    noise: float | None = Field(default=None, gt=0)
    resolution: float | None = Field(default=None, gt=0)


class LimitsFile(TomlTable):
    """Content of a file of limits."""

    drive: dict[str, DriveTable] = Field(min_length=1)
    sensor: dict[str, SensorTable] = Field(default_factory=dict)


def read_limits(
    options: ExcitationOptions, path: Path | None, texts: Sequence[str], drives: Sequence[str]
) -> ExcitationOptions:
    """Return options with the limits of a file and of texts, which win, for some drives.

    Args:
        options: what is stated beside.
        path: TOML file; None for none.
        texts: such as ``servo:force=200,stroke=1e-3``.
        drives: drives that act, in their order; all of file and texts if empty.

    Raises:
        InputError: the file cannot be used.
        UsageError: a text is no limit, or a drive has none.
    """
    file = None if path is None else read_toml(path, LimitsFile)
    limits = {} if file is None else {n: DriveLimits(**dict(t)) for n, t in file.drive.items()}
    sensors: Mapping[str, SensorTable] = {} if file is None else file.sensor
    for text in texts:
        name, values = parse_limit(text)
        limits[name] = replace(limits.get(name, DriveLimits()), **values)
    for drive in drives:
        if drive not in limits:
            source = path or "--limits"
            raise InputError(
                f"{source} states no limit of {drive}: add [drive.{drive}], or --limit "
                f"{drive}:force=VALUE"
            )
    noise = {name: row.noise for name, row in sensors.items() if row.noise is not None}
    steps = {name: row.resolution for name, row in sensors.items() if row.resolution is not None}
    return replace(
        options,
        limits={name: limits[name] for name in drives or limits},
        noise={**noise, **options.noise},
        steps={**steps, **options.steps},
    )


def parse_limit(text: str) -> tuple[str, dict[str, Any]]:
    """Return the drive and the numbers of a text such as ``servo:force=200,stroke=1e-3``.

    Raises:
        UsageError: the text is none.
    """
    name, colon, rest = text.rpartition(":")
    numbers: dict[str, Any] = {}
    for part in rest.split(","):
        key, _, value = part.partition("=")
        try:
            numbers[key.strip()] = float(value)
        except ValueError:
            break
    else:
        if colon and name and numbers.keys() <= set(_LIMIT_NAMES):
            return name, numbers
    raise UsageError(
        f"--limit {text!r}: write DRIVE:NAME=VALUE,..., with names among {', '.join(_LIMIT_NAMES)}"
    )
