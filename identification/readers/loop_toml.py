"""Tables of control loops, as they stand in campaign.toml and budget.toml."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Discriminator, Field, Tag

from identification.readers.toml_files import (
    FILE_TAG,
    TABLE_TAG,
    FileName,
    TomlTable,
    tag_file_or_table,
)
from identification.words import Quantity

_MAX_ROOTS = 100  # of a controller
MIN_PERIOD_S = 1e-7  # of a sampled controller
Root = float | Annotated[list[float], Field(min_length=2, max_length=2)]


class ControllerTable(TomlTable):
    """A controller by its zeros and poles [rad/s]; a complex one is ``[real, imaginary]``.

    With the sampling period ``period`` [s] it is sampled, and zeros and poles are those in z.
    """

    zeros: list[Root] = Field(default_factory=list, max_length=_MAX_ROOTS)
    poles: list[Root] = Field(default_factory=list, max_length=_MAX_ROOTS)
    gain: float
    period: float | None = Field(default=None, ge=MIN_PERIOD_S, le=1.0)


# A file beside the TOML file, or zeros, poles and gain.
ControllerSource = Annotated[
    Annotated[FileName, Tag(FILE_TAG)] | Annotated[ControllerTable, Tag(TABLE_TAG)],
    Discriminator(tag_file_or_table),
]


class LoopTable(TomlTable):
    """Settings of ``[loop.NAME]``: a controller between an output and an input.

    Simulations in time have the ``resolution`` of the encoder, the ``quantisation`` of the control
    and its ``limit``, which linear predictions leave out.
    """

    input: str
    output: str
    minus: str | None = None
    quantity: Quantity = "receptance"
    controller: ControllerSource
    delay: float = Field(default=0.0, ge=0, le=1.0)
    resolution: float = Field(default=0.0, ge=0)
    quantisation: float = Field(default=0.0, ge=0)
    limit: float | None = Field(default=None, gt=0)


class CampaignLoopTable(LoopTable):
    """Settings of ``[loop.NAME]`` in campaign.toml: a loop that was closed during the test.

    ``as_stated = true`` says that it is right, even if the nominal machine is unstable with it.
    """

    as_stated: bool = False


def as_roots(values: Sequence[Root]) -> list[complex]:
    """Return zeros or poles as complex numbers."""
    return [complex(*value) if isinstance(value, list) else complex(value) for value in values]
