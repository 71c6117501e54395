"""A measured campaign, opened from its folder.

A campaign and its model, opened together for tuning and diagnosis.

The measured modal model of a campaign.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from identification import correct_layout, read_layout, read_settings
from identification import read_campaign as read_tests
from identification import select_band as select_campaign_band
from identification.modal import ModeCriteria, modal_state_space
from identification.modal import identify as identify_campaign
from identification.readers.campaign_toml import model_file
from identification.result.collect import check_measurement, collect_result
from identification.result.parts import no_reference_modes
from identification.result.remarks import list_findings
from identification.roving_hammer import shape_points
from identification.words import Campaign, ModalModel, Real, UsageError, shorten_names
from mbmodel import as_drawn, load_machine
from mbworkbench.labels import AnyPath, as_path, check_band
from mbworkbench.model import MachineModel
from mbworkbench.tables import Shown, Table
from tuning import Checkpoint, Session, find_wrong_exports, open_session
from tuning.checks.export_finding import describe_wrong_exports
from tuning.session import prepare_machine


@dataclass(frozen=True, eq=False)
class MeasuredCampaign(Shown):
    """The hammer tests of one machine, as a campaign folder holds them.

    Attributes:
        source: path of its ``campaign.toml``.
        content: layout, tests with their FRFs, tolerances and remarks; all frequency lines.
    """

    source: Path
    content: Campaign

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.content.name

    @property
    def outputs(self) -> tuple[str, ...]:
        """Labels of the measured channels."""
        return tuple(str(dof) for dof in self.content.outputs)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Labels of the points and directions that were hit."""
        return tuple(str(dof) for dof in self.content.inputs)

    def __repr__(self) -> str:
        """Return a summary of at most ten lines."""
        freq, content = self.content.freq_hz, self.content
        return "\n".join(
            (
                f"campaign {self.name}: {len(content.tests)} tests, {len(self.outputs)} channels, "
                f"{len(freq)} lines {freq[0]:g}..{freq[-1]:g} Hz, "
                f"{content.tests[0].estimate.frf.quantity}",
                f"  hit at {shorten_names(self.inputs)}",
                *(f"  {remark}" for remark in content.remarks[:5]),
            )
        )

    def table(self) -> Table:
        """Return a table of the tests."""
        rows = [
            (
                test.condition.test,
                test.condition.reference,
                test.condition.level_n,
                test.estimate.averages,
                len(test.estimate.frf.outputs),
                test.estimate.variance_source,
            )
            for test in self.content.tests
        ]
        header = ("file", "hit at", "level [N]", "averages", "channels", "variance from")
        return Table(repr(self).splitlines()[0], header, rows)


def read_campaign(path: AnyPath) -> MeasuredCampaign:
    """Read a campaign folder: ``campaign.toml``, the model or layout named there, and the tests.

    Args:
        path: the folder, or its ``campaign.toml``.

    Raises:
        InputError: a file that cannot be used; the sentence names file, element and remedy.
    """
    source, settings = read_settings(as_path(path))
    if settings.layout is not None:
        layout = read_layout(source.parent / settings.layout)
    else:
        layout = load_machine(source.parent / str(settings.model), key=settings.key).layout
    layout = correct_layout(source, settings, layout)
    return MeasuredCampaign(source, read_tests(source, settings, layout))


_P = ParamSpec("_P")
_R = TypeVar("_R")


def select_band(campaign: MeasuredCampaign, band: tuple[float, float] | None) -> Campaign:
    """Return the tests of a campaign on the lines of a band.

    Args:
        campaign: all lines.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.

    Raises:
        InputError: the band holds no line.
        UsageError: the lower frequency does not come first.
    """
    content = campaign.content
    return select_campaign_band(content, check_band(band), campaign.source)


def open_together(
    campaign: MeasuredCampaign | AnyPath,
    model: MachineModel | None,
    band: tuple[float, float] | None,
) -> Session:
    """Open a campaign with the model that it names, or with another one.

    The tests of a campaign that was read are used as they are. With another model its files are
    read anew, since their labels refer to the bodies and points of that model.

    Args:
        campaign: from ``read_campaign``, or the path of its folder.
        model: the nominal model; the one that ``campaign.toml`` names if None.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.

    Raises:
        InputError: campaign or model cannot be used, or the band holds no line.
        UsageError: campaign and model are exchanged, or the lower frequency of the band does not
            come first.
    """
    if isinstance(campaign, MachineModel) or isinstance(model, MeasuredCampaign):
        raise UsageError(
            "the campaign comes first and the model by its name: call tune(campaign, model=model) "
            "or diagnose(campaign, model=model)"
        )
    if not isinstance(model, MachineModel | None):
        raise UsageError(f"{model!r} is no model: give what read_model returned, or None")
    machine = None if model is None else model.machine
    if not isinstance(campaign, MeasuredCampaign):
        return open_session(as_path(campaign), check_band(band), machine)
    tests = campaign.content if model is None else None
    return open_session(campaign.source, check_band(band), machine, tests)


def takes_a_campaign(call: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that refuses more than a campaign by position, and prints the new call."""

    @wraps(call)
    def check_positions(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        if len(args) > 1:
            name = getattr(call, "__name__", "")
            raise UsageError(f"a model is given by its name: mb.{name}(campaign, model=model)")
        return call(*args, **kwargs)

    return check_positions


def open_checkpoint(file: AnyPath | None, key: Callable[[], str]) -> Checkpoint | None:
    """Return the finished steps of a file, which is made where it does not exist; None for none.

    Args:
        file: path, or None.
        key: returns the fingerprint of inputs and options.

    Raises:
        InputError: the file was altered, or is that of other inputs.
    """
    return None if file is None else Checkpoint(as_path(file), key(), resume=True)


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
    wrong = _find_wrong_exports(campaign.source, chosen)
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
        (*wrong, *list_findings(result)),
    )


def _find_wrong_exports(source: Path, campaign: Campaign) -> list[str]:
    """Return sentences on files that differ from the nominal model as a whole, as by a unit."""
    _, settings = read_settings(source)
    if settings.layout is not None:
        return []
    nominal = load_machine(model_file(source, settings), key=settings.key)
    model = as_drawn(prepare_machine(source, settings, nominal)[0])
    return describe_wrong_exports(find_wrong_exports(source, model, campaign))
