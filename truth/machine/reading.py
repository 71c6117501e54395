"""Read a machine: one that its own values describe in full, else any MJCF through MuJoCo."""

from pathlib import Path

from truth.errors import TruthError
from truth.machine import mjcf_reader
from truth.machine.mujoco_reader import read_machine
from truth.machine.station import Station


def read_station(path: Path) -> Station:
    """Read a nominal machine.

    Bodies with springs along joints, without weight, tendons or actuators, become a station that
    can be written again with other masses and joints. Any other MJCF is read through MuJoCo: it
    keeps its compiled model, and campaigns hold copies of its files.

    Args:
        path: an MJCF.

    Raises:
        TruthError: the file cannot be read, or has no linear model.
    """
    try:
        return mjcf_reader.read_station(path)
    except TruthError:
        return read_machine(path)


def why_as_drawn(path: Path) -> str:
    """Return why a machine is tested as it is drawn; empty if drawings of its own can be drawn."""
    try:
        mjcf_reader.read_station(path)
    except TruthError as reason:
        return str(reason).removesuffix("; remove it")
    return ""
