"""The measured modal model of a campaign."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification.modal import ModeCriteria, modal_state_space
from identification.modal import identify as identify_campaign
from identification.result.collect import check_measurement, collect_result
from identification.result.reference_shapes import no_reference_modes
from identification.result.remarks import list_findings
from identification.roving_hammer import shape_points
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
        remarks: what limits the model, and findings on bodies, set-ups and levels, one sentence
            each, as ``mbw identify`` gives them.
    """

    campaign: str
    band: tuple[float, float]
    model: ModalModel
    count: int
    remarks: tuple[str, ...]

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
        """Return the modes in one line, and the first remarks below, nine at most."""
        listed = shorten_names([f"{value:.4g}" for value in self.freq_hz])
        head = (
            f"{self.count} modes of {self.campaign} in {self.band[0]:g}..{self.band[1]:g} Hz: "
            f"{listed} Hz"
        )
        return "\n".join((head, *(f"  {remark}" for remark in self.remarks[:9])))

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
    identified = identify_campaign(chosen)
    result = collect_result(
        chosen,
        identified,
        ModeCriteria(),
        reference=no_reference_modes(shape_points(chosen)),
        source="",
        checks=check_measurement(chosen, identified),
    )
    return IdentifiedModel(
        campaign.name,
        (float(chosen.freq_hz[0]), float(chosen.freq_hz[-1])),
        identified[0],
        len(result.summary.modes),
        tuple(list_findings(result)),
    )
