"""A campaign of impacts without a force: a folder with a campaign.toml that names the records.

layout = "layout.toml"      # places of the sensors
band = [15.0, 95.0]         # Hz
ignore = ["acc7_z"]         # channels to be left out, optional

[[impact]]
file = "bow1.npz"
"""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from identification.impacts.common_clock import Struck, struck
from identification.impacts.records import ImpactRecord, read_impact
from identification.impacts.spectra import ImpactSpectra, impact_spectra
from identification.readers.campaign_toml import campaign_file, plain_toml, read_toml
from identification.readers.layout import read_layout
from identification.words import InputError, Layout


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Impact(_Strict):
    file: str


class _ImpactFile(_Strict):
    """The campaign.toml."""

    layout: str
    band: Annotated[list[float], Field(min_length=2, max_length=2)]
    ignore: list[str] = []
    impact: list[_Impact] = Field(min_length=1)


@dataclass(frozen=True, eq=False)
class ImpactCampaign:
    """Records of impacts and where they were read.

    Args:
        path: of the campaign.toml.
        layout: places of sensors.
        records: one for each impact.
        band: lowest and highest line [Hz].
    """

    path: Path
    layout: Layout
    records: tuple[ImpactRecord, ...]
    band: tuple[float, float]

    @cached_property
    def struck(self) -> tuple[Struck, ...]:
        """Each impact on a common clock."""
        return tuple(struck(record) for record in self.records)

    def spectra(self, finer: int = 1) -> ImpactSpectra:
        """Of all impacts; ``finer`` as of ``impact_spectra``."""
        return impact_spectra(self.struck, self.band, finer=finer)


def read_impacts(folder: Path) -> ImpactCampaign:
    """Read a campaign of impacts.

    Raises:
        InputError: a file or key that is missing or wrong.
    """
    path = campaign_file(folder)
    if "test" in plain_toml(path):
        raise InputError(
            f"{path} is a campaign of FRFs, with a force; a match needs impacts that nobody "
            'measured: layout = "layout.toml", band = [15.0, 95.0], [[impact]] file = "bow1.npz"'
        )
    settings = read_toml(path, _ImpactFile)
    low, high = settings.band
    if not 0 < low < high:
        raise InputError(
            f"{path}: band = [{low:g}, {high:g}] is none: give two rising numbers [Hz]"
        )
    layout = read_layout(path.parent / settings.layout)
    files = [one.file for one in settings.impact]
    for file in files:
        if files.count(file) > 1:
            raise InputError(f"{path}: {file} is listed twice. Give every impact once.")
    records = [read_impact(path.parent / file) for file in files]
    if set(settings.ignore) >= {one.name for record in records for one in record.channels}:
        raise InputError(f"{path}: ignore leaves no channel. Keep some.")
    return ImpactCampaign(path, layout, tuple(_left(records, settings.ignore, path)), (low, high))


def _left(records: list[ImpactRecord], ignored: list[str], path: Path) -> list[ImpactRecord]:
    """Records without the channels that are to be left out."""
    unknown = sorted(set(ignored) - {one.name for record in records for one in record.channels})
    if unknown:
        raise InputError(f"{path}: ignore names {unknown[0]}, which no record has.")
    return [
        replace(record, channels=tuple(one for one in record.channels if one.name not in ignored))
        for record in records
    ]
