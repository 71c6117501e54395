"""Content of ``compared.json``, which ``mbw compare`` writes."""

from typing import Literal

from diagnosis import Verdict
from identification.comparison import CellDifference
from identification.readers.result_files import ResultFile, ResultRow

Kind = Literal["visits", "machines", "fleet"]


class CampaignRow(ResultRow):
    """A compared campaign.

    Args:
        name: name, unique among the campaigns.
        source: path of its campaign.toml.
    """

    name: str
    source: str


class ShiftRow(ResultRow):
    """Difference of a number of a mode, the second test less the first.

    Args:
        value, sd: difference and its standard deviation by the noise of both tests.
        significance: difference over this deviation; null if the noise is zero.
        changed: whether neither noise nor the drift between two visits explains it.
    """

    value: float
    sd: float
    significance: float | None
    changed: bool


class ScatterRow(ResultRow):
    """Scatter of a number of a mode over the machines of a fleet.

    Args:
        mean: mean over the machines that have the mode.
        spread: standard deviation between machines; null for a single one.
        within: standard deviation within a test.
        stands_out: names of the campaigns that lie apart from the others.
    """

    mean: float
    spread: float | None
    within: float
    stands_out: list[str]


class ComparedModeRow(ResultRow):
    """A mode; its lists have an entry for each campaign, null where the mode was not found.

    Args:
        frequency, frequency_sd: natural frequencies and their standard deviations [Hz].
        damping, damping_sd: damping ratios and their standard deviations.
        mac: MAC with the shape in the first campaign that has the mode, at the shared channels.
        probability: probability of the pairing with it.
        frequency_shift, damping_shift: differences of two campaigns; null for an unpaired mode
            and for a fleet.
        frequency_scatter, damping_scatter: scatter over a fleet; null for two campaigns.
    """

    frequency: list[float | None]
    frequency_sd: list[float | None]
    damping: list[float | None]
    damping_sd: list[float | None]
    mac: list[float | None]
    probability: list[float | None]
    frequency_shift: ShiftRow | None = None
    damping_shift: ShiftRow | None = None
    frequency_scatter: ScatterRow | None = None
    damping_scatter: ScatterRow | None = None


class ComparedFile(ResultFile):
    """Content of ``compared.json``.

    Args:
        kind: ``visits`` of one machine, ``machines`` of one drawing, or a ``fleet``.
        campaigns: compared campaigns, the first before a change.
        sentence: what the modes show.
        change: what the diagnosis of the change shows; null without one.
        without_diagnosis: why there is no diagnosis; null if there is one.
        remarks: sentences on what could not be compared, and on the tests.
        band: lowest and highest frequency that was compared [Hz].
        channels: labels of the channels that all campaigns share.
        modes: modes by rising frequency.
        frfs: differences of FRFs, the largest first; empty for a fleet.
        verdict: verdict of the change, as ``mbw diagnose`` writes it; null without a diagnosis.
    """

    kind: Kind
    campaigns: list[CampaignRow]
    sentence: str
    change: str | None = None
    without_diagnosis: str | None = None
    remarks: list[str]
    band: tuple[float, float]
    channels: list[str]
    modes: list[ComparedModeRow]
    frfs: list[CellDifference]
    verdict: Verdict | None = None
