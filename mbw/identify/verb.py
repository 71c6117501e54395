"""``mbw identify``: identification of a campaign's modal model."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import typer

from identification.modal import ModeChoices, ModeCriteria, identify
from identification.result.collect import check_measurement, collect_result
from identification.result.parts import (
    ReferenceModes,
    no_reference_modes,
    read_reference_modes,
)
from identification.result.remarks import list_findings
from identification.result.schema import IdentifiedModesFile
from identification.result.stored_result import IdentificationResult
from identification.roving_hammer import (
    is_roving_hammer,
    shape_points,
)
from identification.words import Campaign, Output, UsageError
from mbmodel import Machine, as_drawn, machine_geometry, model_modes, shapes_at
from mbw.any_campaign import open_any_campaign
from mbw.files import write_json
from mbw.identify.animate import (
    ModeAnimation,
    parse_animations,
    refuse_missing_modes,
    write_animations,
)
from mbw.identify.files import NAMES, PAGE, write_files, write_full_matrix
from mbw.identify.page import render
from mbw.identify.tips import TIPS_PAGE, TipComparison, compare_tips, write_tips
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions
from tuning import find_wrong_exports
from tuning.checks.export_finding import describe_wrong_exports

_MODEL_BAND_FACTOR = 1.3  # highest compared frequency of the model, over the band's highest line
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9.=_]+")  # of folders


@dataclass(frozen=True)
class IdentifyChoices:
    """Choices of the user about an identification.

    Args:
        criteria: criteria of the stabilisation diagram.
        add, drop: frequencies of modes to add and to leave out [Hz].
        force: texts ``HZ,PERCENT`` of modes that are kept as stated.
        against: universal file with reference shapes; None for the nominal model.
        full: whether to write the FRFs between all outputs.
        animate: texts ``NUMBER FILE`` of modes to be written as pictures.
        compare: campaigns with other hammer tips.
    """

    criteria: ModeCriteria = field(default_factory=ModeCriteria)
    add: Sequence[float] = ()
    drop: Sequence[float] = ()
    force: Sequence[str] = ()
    against: Path | None = None
    full: bool = False
    animate: Sequence[str] = ()
    compare: Sequence[Path] = ()

    @cached_property
    def modes(self) -> ModeChoices:
        """Modes to add, to drop, to force."""
        return ModeChoices(tuple(self.add), tuple(self.drop), parse_forced_modes(self.force))

    @cached_property
    def animations(self) -> tuple[ModeAnimation, ...]:
        """Modes to be written as pictures."""
        return parse_animations(self.animate)

    def check(self) -> None:
        """Refuse texts that cannot be used before anything is read.

        Raises:
            UsageError: a text that states no mode, or a picture of an unknown kind.
            InputError: a picture cannot be written.
        """
        _ = self.modes, self.animations


def run(
    campaign: Path,
    outputs: ResultOptions,
    choices: IdentifyChoices,
    band: tuple[float, float] | None,
) -> Path:
    """Identify the modes, write the modal model and its page, print a table of the modes.

    Args:
        band: lowest and highest frequency [Hz]; None for the frequency lines with coherence.

    Returns:
        The folder of the result.
    """
    choices.check()
    with SCREEN.status("reading and checking the tests"):
        source, machine, whole = open_any_campaign(campaign, band)
        whole = whole.leave_out_after()
        if machine is not None:  # the modes are right in any unit, their masses are not
            exports = find_wrong_exports(source, as_drawn(machine), whole)
            remarks = (*whole.remarks, *describe_wrong_exports(exports))
            whole = replace(whole, remarks=remarks)
    first, *further = [
        TestsOfMachine.of_variant(machine, whole, name) for name in sorted(whole.variants, key=bool)
    ]
    comparison = _compare_tips(first.campaign, choices.compare, band)
    folder = _run_machine(source, first, outputs, choices, comparison)
    plain = replace(choices, add=(), drop=(), force=(), animate=())
    for tests in further:
        SCREEN.say(f"tests with {tests.variant}, which have modes of their own:")
        out = outputs.out
        out = None if out is None else out.with_name(f"{out.name}-{tests.slug}")
        _run_machine(source, tests, replace(outputs, out=out, json=None), plain, None)
    return folder


@dataclass(frozen=True, eq=False)
class TestsOfMachine:
    """Tests that were made in one machine, such as one with a known mass.

    Args:
        machine: in which they were made; None for a layout.
        campaign: these tests.
        variant: its name; empty for the machine of the campaign.
    """

    machine: Machine | None
    campaign: Campaign
    variant: str

    @classmethod
    def of_variant(cls, machine: Machine | None, campaign: Campaign, name: str) -> "TestsOfMachine":
        """Return the tests of one variant of a machine."""
        chosen = machine.variants[name] if name and machine is not None else machine
        return cls(chosen, campaign.select_variant(name), name)

    @property
    def slug(self) -> str:
        """Name of the variant as a part of a folder's name."""
        return _NOT_IN_NAMES.sub("-", self.variant.replace(".xml", ""))


def _run_machine(
    source: Path,
    tests: TestsOfMachine,
    outputs: ResultOptions,
    choices: IdentifyChoices,
    comparison: TipComparison | None,
) -> Path:
    """Identify the modes of the tests of one machine and write its folder.

    Args:
        tests: made in one machine.
        comparison: of hammer tips; None for none.
    """
    machine, band_campaign = tests.machine, tests.campaign
    suffix = f"modes-{tests.slug}" if tests.variant else "modes"
    with outputs.open("identify", source, suffix, NAMES) as output:
        result = _identify(machine, band_campaign, choices)
        refuse_missing_modes(choices.animations, len(result.summary.modes))
        with output.write() as place:
            write_files(result, place)
            if choices.full:
                write_full_matrix(result, place)
            if comparison is not None:
                write_tips(comparison, place, has_page=outputs.pictures)
            if outputs.pictures:
                geometry = None if machine is None else machine_geometry(machine)
                (place / PAGE).write_text(render(result, geometry), encoding="utf-8")
    write_animations(result, machine, choices.animations)
    write_json(result.summary.model_dump_json(indent=1), outputs.json)
    if outputs.has_tables:
        _print(result.summary)
    for text in list_findings(result):
        SCREEN.say(text)
    _say_tips(comparison, output.path, has_page=outputs.pictures)
    SCREEN.say(f"modal model in {output.path}")
    outputs.say_page(output.path / PAGE)
    return output.path


def _identify(
    machine: Machine | None, campaign: Campaign, choices: IdentifyChoices
) -> IdentificationResult:
    """Identify the modes and check the channels of each body."""
    reference = _reference_modes(choices.against, machine, campaign)
    with SCREEN.status("poles, shapes, refinement"):
        identified = identify(campaign, choices.criteria, choices.modes)
    if machine is not None and machine.loops and is_roving_hammer(campaign):
        SCREEN.say(
            "the hammer roved while a control loop was closed: shapes assume reciprocity, which a "
            "machine in a loop does not have"
        )
    with SCREEN.status("bodies, set-ups, modes at each level"):
        checks = check_measurement(campaign, identified)
    source = "" if machine is None else str(machine.source.absolute())
    return collect_result(
        campaign,
        identified,
        choices.criteria,
        reference=reference,
        source=source,
        keyframe=None if machine is None else machine.keyframe,
        checks=checks,
    )


def _reference_modes(
    against: Path | None, machine: Machine | None, campaign: Campaign
) -> ReferenceModes:
    """Return the modes with which the measured ones are compared."""
    outputs = shape_points(campaign)
    if against is not None:
        return read_reference_modes(against, outputs, campaign.layout)
    if machine is not None:
        return compute_nominal_modes(machine, outputs, float(campaign.freq_hz[-1]))
    return no_reference_modes(outputs)


def compute_nominal_modes(
    machine: Machine, outputs: tuple[Output, ...], highest_hz: float
) -> ReferenceModes:
    """Compute the oscillating modes of the nominal model, as the MJCF describes the machine.

    Args:
        machine: machine with the campaign's layout.
        outputs: measured channels.
        highest_hz: highest frequency of the band [Hz].
    """
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    kept = (modes.poles.imag > 0) & (modes.freq_hz <= _MODEL_BAND_FACTOR * highest_hz)
    shapes = shapes_at(model, model.drawn, modes, outputs)[:, kept]
    return ReferenceModes(
        f"{machine.name} as drawn",
        modes.freq_hz[kept],
        modes.damping[kept],
        shapes,
        np.ones(len(outputs), bool),
    )


def _compare_tips(
    campaign: Campaign, compared: Sequence[Path], band: tuple[float, float] | None
) -> TipComparison | None:
    """Compare the hammer tips of campaigns; None if no other campaign is named."""
    if not compared:
        return None
    return compare_tips([campaign, *(open_any_campaign(path, band)[2] for path in compared)])


def _say_tips(comparison: TipComparison | None, folder: Path, *, has_page: bool) -> None:
    if comparison is None:
        return
    for text in comparison.sentences:
        SCREEN.say(text)
    if has_page:
        SCREEN.say(f"hammer tips in {(folder / TIPS_PAGE).absolute().as_uri()}")


def parse_forced_modes(texts: Sequence[str]) -> tuple[tuple[float, float], ...]:
    """Return frequencies [Hz] and damping ratios from texts ``HZ,PERCENT``.

    Raises:
        UsageError: a text is not two numbers, or the numbers cannot be those of a mode.
    """
    modes = []
    for text in texts:
        try:
            frequency, percent = (float(part) for part in text.split(","))
        except ValueError as error:
            raise UsageError(
                f"--force {text} does not state a frequency and a damping ratio: write --force "
                "120.5,2 for 120.5 Hz and 2 per cent"
            ) from error
        if not (0 < frequency < 1e9 and 0 < abs(percent) < 100):
            raise UsageError(
                f"--force {text}: give a frequency above 0 Hz and a damping ratio between 0 and "
                "100 per cent, or between -100 and 0 for a mode that grows"
            )
        modes.append((frequency, percent / 100))
    return tuple(modes)


def _print(summary: IdentifiedModesFile) -> None:
    typer.echo(
        "mode  frequency/Hz       sd  damping/%       sd  collinearity  orders  reference/Hz   MAC"
        + ("  doubtful" if any(row.doubtful for row in summary.modes) else "")
    )
    for number, row in enumerate(summary.modes, start=1):
        orders = "-" if row.orders is None else str(row.orders)
        reference = "-" if row.other is None else f"{row.other:.2f}"
        mac = "-" if row.other_mac is None else f"{row.other_mac:.2f}"
        typer.echo(
            f"{number:4d}  {row.frequency:12.3f}  {row.frequency_sd:7.4f}  "
            f"{100 * row.damping:9.3f}  {100 * row.damping_sd:7.4f}  "
            f"{row.phase_collinearity:12.3f}  {orders:>6}  {reference:>12}  {mac:>4}"
            + ("  yes" if row.doubtful else "")
        )
    outside = f" and {summary.beside_band} poles outside it" if summary.beside_band else ""
    SCREEN.say(
        f"{len(summary.modes)} modes in {summary.band[0]:g}..{summary.band[1]:g} Hz{outside}; the "
        f"squared residual is {summary.misfit:.3g} times the variance of the noise"
    )
