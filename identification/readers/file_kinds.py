"""Kinds of files, and what campaign.toml has to state of a test of each kind."""

from pathlib import Path
from typing import TypedDict

from identification.readers.campaign_toml import TestSettings
from identification.words import InputError, Quantity

_ARRAYS = (".mat", ".npz")
_UNIVERSAL = (".uff", ".unv", ".uf", ".bunv")
_SAID_INSIDE = ("channels", "references", "unit")


class Stated(TypedDict):
    """What an array file does not say itself, as its readers want it."""

    channels: str | list[str]
    references: list[str]
    quantity: Quantity
    unit: str | None


def is_arrays(file: Path) -> bool:
    """Whether a file is one of MATLAB or numpy, by its suffix."""
    return file.suffix.lower() in _ARRAYS


def is_universal(file: Path) -> bool:
    """Whether a file is a universal file, by its suffix."""
    return file.suffix.lower() in _UNIVERSAL


def stated(file: Path, entry: TestSettings) -> Stated:
    """What the ``[[test]]`` of an array file states: the quantity is accelerance unless it does.

    Raises:
        InputError: without channels or references.
    """
    if entry.channels is None or entry.references is None:
        raise InputError(
            f"{file} does not say its channels: add channels and references to its [[test]]"
        )
    return {
        "channels": entry.channels,
        "references": entry.references,
        "quantity": entry.quantity or "accelerance",
        "unit": entry.unit,
    }


def refuse_stated(file: Path, entry: TestSettings) -> None:
    """Refuse a ``[[test]]`` that states what its universal file says itself.

    Raises:
        InputError: with the key.
    """
    for key in _SAID_INSIDE:
        if getattr(entry, key) is not None:
            raise InputError(f"{file} says its {key} itself: remove {key} from its [[test]]")
