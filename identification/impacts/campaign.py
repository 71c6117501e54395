"""Campaign of impacts with unmeasured force: a folder whose campaign.toml names the records.

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

from pydantic import Field

from identification.impacts.common_clock import SynchronisedImpact, synchronise
from identification.impacts.records import ImpactRecord, read_impact
from identification.impacts.spectra import ImpactSpectra, impact_spectra
from identification.readers.campaign_toml import find_campaign_file
from identification.readers.layout import read_layout
from identification.readers.toml_files import FileName, TomlTable, load_toml, read_toml
from identification.words import InputError, Layout


class _Impact(TomlTable):
    file: FileName


class _ImpactCampaignFile(TomlTable):
    """Content of the campaign.toml."""

    layout: FileName
    band: Annotated[list[float], Field(min_length=2, max_length=2)]
    ignore: list[str] = Field(default_factory=list)
    impact: list[_Impact] = Field(min_length=1)


@dataclass(frozen=True, eq=False)
class ImpactCampaign:
    """Records of impacts and the places of their sensors.

    Args:
        path: path of the campaign.toml.
        layout: places of sensors.
        records: one for each impact.
        band: lowest and highest frequency line [Hz].
    """

    path: Path
    layout: Layout
    records: tuple[ImpactRecord, ...]
    band: tuple[float, float]

    @cached_property
    def impacts(self) -> tuple[SynchronisedImpact, ...]:
        """Each impact with its channels on a common clock."""
        return tuple(synchronise(record) for record in self.records)

    def spectra(self, finer: int = 1) -> ImpactSpectra:
        """Return the spectra of all impacts; ``finer`` as for ``impact_spectra``."""
        return impact_spectra(self.impacts, self.band, finer=finer)


def read_impacts(folder: Path) -> ImpactCampaign:
    """Read a campaign of impacts.

    Args:
        folder: folder with the campaign.toml.

    Raises:
        InputError: a file or key that is missing or wrong.
    """
    path = find_campaign_file(folder)
    if "test" in load_toml(path):
        raise InputError(
            f"{path} is a campaign of FRFs with a measured force; a match needs impacts whose "
            'force is not measured: layout = "layout.toml", band = [15.0, 95.0], '
            '[[impact]] file = "bow1.npz"'
        )
    settings = read_toml(path, _ImpactCampaignFile)
    low, high = settings.band
    if not 0 < low < high:
        raise InputError(
            f"{path}: band = [{low:g}, {high:g}] is not a band: give two rising numbers [Hz]"
        )
    layout = read_layout(path.parent / settings.layout)
    files = [impact.file for impact in settings.impact]
    for file in files:
        if files.count(file) > 1:
            raise InputError(f"{path}: {file} is listed twice. Give every impact once.")
    records = [read_impact(path.parent / file) for file in files]
    if set(settings.ignore) >= {channel.name for record in records for channel in record.channels}:
        raise InputError(f"{path}: ignore leaves no channel. Keep some.")
    return ImpactCampaign(
        path, layout, tuple(_drop_channels(records, settings.ignore, path)), (low, high)
    )


def _drop_channels(
    records: list[ImpactRecord], ignored: list[str], path: Path
) -> list[ImpactRecord]:
    """Return the records without the channels that are to be left out."""
    unknown = sorted(
        set(ignored) - {channel.name for record in records for channel in record.channels}
    )
    if unknown:
        raise InputError(f"{path}: ignore names {unknown[0]}, which no record has.")
    return [
        replace(
            record,
            channels=tuple(channel for channel in record.channels if channel.name not in ignored),
        )
        for record in records
    ]
