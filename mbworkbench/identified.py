"""The measured modal model of a campaign."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification.modal import identify as identify_campaign
from identification.modal import modal_state_space
from identification.words import ModalModel, Real, UsageError, shorten_names
from mbworkbench.campaign import MeasuredCampaign, read_campaign, select_band
from mbworkbench.labels import AnyPath
from mbworkbench.tables import Shown, Table

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class IdentifiedModel(Shown):
    """Modes that were identified in the band of a campaign.

    Attributes:
        campaign: name of the campaign.
        band: lowest and highest frequency that was used [Hz].
        model: poles, shapes, participation, residuals and standard deviations; the modes inside
            the band come first.
        count: number of modes inside the band.
    """

    campaign: str
    band: tuple[float, float]
    model: ModalModel
    count: int

    @property
    def freq_hz(self) -> Real:
        """Natural frequencies of the modes inside the band [Hz]; (count,)."""
        return self.model.freq_hz[: self.count]

    @property
    def damping(self) -> Real:
        """Damping ratios of the modes inside the band; (count,)."""
        return self.model.damping[: self.count]

    def to_control(self) -> "control.StateSpace":
        """Return the receptance between the measured labels as a state space of python-control."""
        import control  # noqa: PLC0415  # slow to load

        return control.ss(
            *modal_state_space(self.model),
            inputs=list(map(str, self.model.inputs)),
            outputs=list(map(str, self.model.outputs)),
        )

    def __repr__(self) -> str:
        """Return the number of modes and their frequencies in one line."""
        listed = shorten_names([f"{value:.4g}" for value in self.freq_hz])
        return (
            f"{self.count} modes of {self.campaign} in {self.band[0]:g}..{self.band[1]:g} Hz: "
            f"{listed} Hz"
        )

    def table(self) -> Table:
        """Return a table of the modes with standard deviations."""
        model = self.model
        rows = [
            (
                number + 1,
                float(model.freq_hz[number]),
                float(model.freq_sd[number]),
                100 * float(model.damping[number]),
                100 * float(model.damping_sd[number]),
            )
            for number in range(self.count)
        ]
        header = ("mode", "frequency [Hz]", "sd [Hz]", "damping [%]", "sd [%]")
        return Table(f"Modes of {self.campaign}", header, rows)


def identify(
    campaign: MeasuredCampaign | AnyPath,
    band: tuple[float, float] | None = None,
    variant: str | None = None,
) -> IdentifiedModel:
    """Identify the modal model of a campaign.

    Args:
        campaign: from ``read_campaign``, or the path of its folder.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.
        variant: of tests with models or poses of their own, those that are identified, such as
            ``loaded.xml``; empty for the machine of the campaign; None if all have one machine.

    Raises:
        InputError: the campaign cannot be used, the band holds no line, or its tests were made in
            several machines and none is stated.
        UsageError: the lower frequency of the band does not come first.
    """
    if not isinstance(campaign, MeasuredCampaign):
        campaign = read_campaign(campaign)
    chosen = select_band(campaign, band)
    if variant is not None:
        if variant not in chosen.variants:
            raise UsageError(f"{variant!r} is no variant of the campaign: {chosen.variants} are")
        chosen = chosen.select_variant(variant)
    model, identified, _ = identify_campaign(chosen)
    freq = chosen.freq_hz
    return IdentifiedModel(
        campaign.name, (float(freq[0]), float(freq[-1])), model, int(identified.inside.sum())
    )
