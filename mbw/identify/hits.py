"""Hits of raw time records on the page of ``mbw identify``."""

from typing import Any

from identification.result.schema import HitsRow
from mbw.page.html import pack_real, read_asset


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
