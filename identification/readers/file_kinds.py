"""Kinds of measurement files, and the keys of campaign.toml that each kind needs."""

from pathlib import Path
from typing import TypedDict

from identification.readers.array_files import TEXT_SUFFIXES
from identification.readers.campaign_toml import TestSettings
from identification.readers.units import quantity_of_unit
from identification.words import InputError, Quantity

_ARRAY_SUFFIXES = (".mat", ".npz", *TEXT_SUFFIXES)
_UNIVERSAL_SUFFIXES = (".uff", ".unv", ".uf", ".ufb", ".bunv")


class ArrayDescription(TypedDict):
    """Channels, references, quantity and unit of an array file, as its readers need them."""

    channels: str | list[str]
    references: list[str]
    quantity: Quantity
    unit: str | None


def is_arrays(file: Path) -> bool:
    """Return whether a file is a MATLAB, numpy or text file, by its suffix."""
    return file.suffix.lower() in _ARRAY_SUFFIXES


def is_universal(file: Path) -> bool:
    """Return whether a file is a universal file, by its suffix."""
    return file.suffix.lower() in _UNIVERSAL_SUFFIXES


def array_description(file: Path, entry: TestSettings) -> ArrayDescription:
    """Return the description of an array file from its ``[[test]]``.

    Without a stated quantity, the unit says it; without both it is accelerance.

    Raises:
        InputError: channels or references are missing.
    """
    if entry.channels is None or entry.references is None:
        raise InputError(
            f"{file} does not name its channels: add channels and references to its [[test]]"
        )
    return {
        "channels": entry.channels,
        "references": entry.references,
        "quantity": entry.quantity or quantity_of_unit(entry.unit or "") or "accelerance",
        "unit": entry.unit,
    }
