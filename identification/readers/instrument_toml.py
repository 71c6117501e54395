"""Tables of campaign.toml on instruments: ``[sensor.<site>]`` and ``[hammer.<name>]``."""

from typing import Literal

from pydantic import Field

from identification.readers.toml_files import TomlTable, Turn

MAX_STINGER_DIAMETER_M, MAX_STINGER_LENGTH_M = 0.05, 2.0  # beyond, mm were written as m


class SensorSettings(TomlTable):
    """Settings of one ``[sensor.<site>]``: corrections that leave the MJCF as it is.

    A channel that is no site, such as an encoder, goes by its name. ``gain_tolerance`` (relative)
    and ``delay_tolerance`` [s] replace those of ``[tolerance]`` for its channels. ``mass`` [kg] is
    that of the accelerometer, on the machine in the tests of the files that it reads.
    ``resolution`` [m, rad] is the step of an encoder, with which signals are played.
    """

    flip: list[Literal["x", "y", "z"]] = Field(default_factory=list)
    turn: Turn = Field(default=[0.0, 0.0, 0.0])
    ignore: list[Literal["x", "y", "z"]] = Field(default_factory=list)
    body: str | None = None
    gain: Literal["unknown"] | None = None
    gain_tolerance: float | None = Field(default=None, gt=0)
    delay_tolerance: float | None = Field(default=None, gt=0)
    mass: float | None = Field(default=None, gt=0)
    resolution: float | None = Field(default=None, gt=0)


class StingerTable(TomlTable):
    """``stinger``: ``diameter`` and ``length`` [m] of the rod, ``modulus`` [Pa] (steel)."""

    diameter: float = Field(gt=0, le=MAX_STINGER_DIAMETER_M)
    length: float = Field(gt=0, le=MAX_STINGER_LENGTH_M)
    modulus: float = Field(default=2.1e11, gt=0)


class HammerSettings(TomlTable):
    """Settings of one ``[hammer.<name>]``: a hammer or drive that tests name, or ``default``.

    ``mass`` [kg] is what a shaker has on the machine's side of its force gauge, and ``stinger`` the
    rod that holds it. All shakers of a file hang on the machine in each of its tests.
    """

    gain: Literal["unknown"] | None = None
    gain_tolerance: float | None = Field(default=None, gt=0)
    delay_tolerance: float | None = Field(default=None, gt=0)
    mass: float | None = Field(default=None, gt=0)
    stinger: StingerTable | None = None
