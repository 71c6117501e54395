"""Runs of ``mbw simulate`` on the model of two bodies."""

from functools import partial
from pathlib import Path

from small_machine import MJCF

from tests.helpers import command

run = partial(command.run, "simulate")


def write_pair_model(folder: Path) -> Path:
    """Write the model of two bodies; return its file."""
    path = folder / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path
