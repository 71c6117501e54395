"""Sections of the page of ``mbw identify``: checks of solid bodies, hits of time records."""

from typing import Any

import numpy as np

from identification import Fault
from identification.result.schema import HitsRow, SolidRow
from identification.words import DIRECTIONS, Real
from mbw.page.html import pack_real, read_asset

_FAULT_NAMES = {
    "sensor_gain": "gain",
    "sensor_polarity": "reversed polarity",
    "sensor_misalignment": "misalignment",
    "sensor_position": "position",
    "sensor_swap": "exchanged channels",
    "sensor_delay": "delay",
    "mount_resonance": "mount resonance",
    "dead_channel": "no signal",
    "sensor_body": "on another body",
    "sensor_unknown": "unknown fault",
    "flexible_body": "flexible body",
}
_FAULT_UNITS = {  # factor from SI and unit on the page
    "gain": (1.0, ""),
    "rotation": (180 / np.pi, "°"),
    "offset": (1e3, " mm"),
    "delay": (1e3, " ms"),
    "frequency": (1.0, " Hz"),
    "damping": (100.0, " %"),
}


def solid_data(row: SolidRow) -> dict[str, object]:
    """Return the data of the page's script for a body."""
    deviation: Real = np.array(row.deviation)
    return {
        **row.model_dump(include={"body", "channels", "spare", "solid_to", "words", "more"}),
        "freq": pack_real(np.array(row.frequency)),
        "deviation": pack_real(100 * deviation),
        "faults": [_fault_cells(fault) for fault in row.faults],
        "twins": [[fault_words(label) for label in pair] for pair in row.twins],
        "unseen": [fault_words(label) for label in row.unseen],
    }


def _fault_cells(fault: Fault) -> list[str]:
    """Return effect, place, direction, parameters, probability and residual as texts."""
    return [
        _FAULT_NAMES.get(fault.effect, fault.effect),
        _place(fault.location),
        "all" if fault.dof is None else fault.dof.replace("+", ", "),
        "; ".join(parameter_words(*item) for item in fault.parameters.items()) or "-",
        f"{100 * fault.probability:.3g} %",
        f"{fault.excess_after:.3g}",
    ]


def parameter_words(name: str, value: float | tuple[float, ...]) -> str:
    """Return a parameter in SI units as a text such as ``offset 0, 12.3, -4 mm``."""
    factor, unit = _FAULT_UNITS.get(name, (1.0, ""))
    values = value if isinstance(value, tuple) else [value]
    return f"{name} {', '.join(f'{factor * component:.3g}' for component in values)}{unit}"


def fault_words(label: str) -> str:
    """Return a fault's label as a text: ``acc1 tx: gain`` for ``sensor_gain@sensor:acc1:tx``."""
    effect, _, rest = label.partition("@")
    kind, _, place = rest.partition(":")
    point, _, dof = place.rpartition(":")
    if not point or not set(dof.split("+")) <= set(DIRECTIONS):
        point, dof = place, ""
    where = " ".join(part for part in (_place(f"{kind}:{point}"), dof.replace("+", ", ")) if part)
    return f"{where}: {_FAULT_NAMES.get(effect, effect)}"


def _place(location: str) -> str:
    """Return a location without its kind: ``acc1, acc2`` for ``sensor:acc1+acc2``."""
    return location.partition(":")[2].replace("+", ", ")


def hits_section(rows: list[HitsRow]) -> str:
    """Return the HTML of the section; empty without rows."""
    return read_asset("identify/hits.html") if rows else ""


def hits_data(rows: list[HitsRow], arrays: dict[str, Any]) -> list[dict[str, object]]:
    """Return the data of the page's script, for each reference.

    Args:
        rows: rows of modes.json.
        arrays: arrays of modes.npz.
    """
    return [
        {
            **row.model_dump(exclude={"kept", "added_damping", "block"}),
            "kept": len(row.kept),
            "block_s": row.block,
            "peaks": sorted((hit.peak for hit in row.kept), key=abs),
            "added": max(row.added_damping, default=0.0),
            "densities": _pack_densities(arrays, f"hits_{number}_"),
            "noise": _pack_densities(arrays, f"hits_{number}_noise_"),
            "record": _pack_traces(arrays, f"hits_{number}_record_", row),
            "block": _pack_traces(arrays, f"hits_{number}_block_", row),
        }
        for number, row in enumerate(rows, start=1)
    ]


def _pack_densities(arrays: dict[str, Any], prefix: str) -> dict[str, str] | None:
    if f"{prefix}force" not in arrays:
        return None
    return {
        "freq": pack_real(arrays[f"{prefix}freq_hz"]),
        "force": pack_real(arrays[f"{prefix}force"]),
        "motion": pack_real(arrays[f"{prefix}motion"].T),
    }


def _pack_traces(arrays: dict[str, Any], prefix: str, row: HitsRow) -> dict[str, object] | None:
    """Return signals in time, with the times of averaged and rejected hits in their record."""
    if f"{prefix}force" not in arrays:
        return None
    number, time = int(arrays[f"{prefix}number"]), arrays[f"{prefix}time_s"]
    return {
        "number": number,
        "time": pack_real(time),
        "force": pack_real(arrays[f"{prefix}force"]),
        "motion": pack_real(arrays[f"{prefix}motion"].T),
        "kept": [hit.time for hit in row.kept if hit.record == number],
        "rejected": [hit.time for hit in row.rejected if hit.record == number],
    }
