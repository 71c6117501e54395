"""``mbw identify``: the measured modal model of a campaign."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import typer

from identification import (
    band_lines,
    check_bodies,
    correct_layout,
    read_campaign,
    read_layout,
    read_settings,
)
from identification.checks.roving_hammer import exchanged, is_roved, shape_points
from identification.checks.setups import consistency
from identification.modal import Tolerances, Wishes, identify
from identification.words import Campaign, UsageError, WorkbenchError
from mbmodel import Machine, load_machine, looks
from mbw.files import check_json, check_names, write_json
from mbw.identify.files import (
    NAMES,
    PAGE,
    read_result,
    write_files,
    write_full_matrix,
)
from mbw.identify.page import render
from mbw.identify.reference_shapes import Other, drawn_model, nothing, of_file
from mbw.identify.remarks import remarks
from mbw.identify.result import Checks, Result, gather
from mbw.identify.schema import ModesFile
from mbw.messages import SCREEN
from tuning import files_of, open_campaign


@dataclass(frozen=True)
class Targets:
    """Where results go.

    Args:
        out: folder; <campaign>-modes if None.
        json: a file beside it, or ``-``.
        pictures: whether to write the page.
        full: whether to write the FRFs between all outputs.
    """

    out: Path | None
    json: Path | None
    pictures: bool
    full: bool


@dataclass(frozen=True)
class Choices:
    """How to identify.

    Args:
        tolerances: of the stabilisation.
        wishes: modes to add, to drop, to force.
        against: universal file with shapes to compare with; the drawn model if None.
    """

    tolerances: Tolerances
    wishes: Wishes
    against: Path | None


def run(
    campaign: Path, targets: Targets, choices: Choices, band: tuple[float, float] | None
) -> Path:
    """Identify, write the modal model and its page, print the modes.

    Returns:
        The folder of the result.
    """
    machine, chosen = _opened(campaign, band)
    folder = targets.out or Path(f"{chosen.name}-modes")
    check_names(folder, NAMES)
    if targets.json is not None:
        check_json(targets.json)
    other = _other(choices.against, machine, chosen)
    with SCREEN.console.status("poles, shapes, refinement") if not SCREEN.quiet else nullcontext():
        identified = identify(chosen, choices.tolerances, choices.wishes)
        solid = check_bodies(exchanged(chosen) if is_roved(chosen) else chosen)
        checks = Checks(solid, consistency(chosen))
    source = "" if machine is None else str(machine.source.absolute())
    result = gather(
        chosen, identified, choices.tolerances, other=other, source=source, checks=checks
    )
    with files_of(folder) as place:
        write_files(result, place)
        if targets.full:
            write_full_matrix(result, place)
        if targets.pictures:
            seen = None if machine is None else looks(machine)
            (place / PAGE).write_text(render(result, seen), encoding="utf-8")
    if targets.json is not None:
        write_json(result.summary.model_dump_json(indent=1), targets.json)
    if targets.json is None or str(targets.json) != "-":
        _print(result.summary)
    _say(result)
    SCREEN.say(f"modal model in {folder}")
    if targets.pictures:
        SCREEN.say(f"pictures in {(folder / PAGE).absolute().as_uri()}")
    return folder


def _other(against: Path | None, machine: Machine | None, campaign: Campaign) -> Other:
    """Shapes to compare the measured ones with."""
    outputs = shape_points(campaign)
    if against is not None:
        return of_file(against, outputs, campaign.layout)
    if machine is not None:
        return drawn_model(machine, outputs, float(campaign.freq_hz[-1]))
    return nothing(outputs)


def _opened(campaign: Path, band: tuple[float, float] | None) -> tuple[Machine | None, Campaign]:
    """The machine that a campaign names, if it does, and its tests."""
    source, settings = read_settings(campaign)
    if settings.layout is None:
        _, machine, chosen = open_campaign(campaign, band)
        return machine, chosen
    layout = correct_layout(source, settings, read_layout(source.parent / settings.layout))
    whole = read_campaign(source, settings, layout)
    return None, whole.lines(band_lines(whole, band, source))


def page_of(path: Path) -> str:
    """The page of a result folder, or of its modes.json.

    Raises:
        InputError: the folder holds no result.
    """
    result = read_result(path)
    try:
        seen = looks(load_machine(Path(result.summary.model))) if result.summary.model else None
    except WorkbenchError:
        seen = None
        SCREEN.say(f"{result.summary.model} cannot be read: the page shows sensors alone")
    return render(result, seen)


def parse_forced(texts: list[str]) -> tuple[tuple[float, float], ...]:
    """``HZ,PERCENT`` to frequency [Hz] and damping ratio.

    Raises:
        UsageError: no two numbers, or numbers of no mode.
    """
    found = []
    for text in texts:
        try:
            frequency, percent = (float(part) for part in text.split(","))
        except ValueError as error:
            raise UsageError(
                f"--force {text} is no frequency and damping: write --force 120.5,2 for 120.5 Hz "
                "and 2 per cent"
            ) from error
        if not (0 < frequency < 1e9 and 0 < percent < 100):
            raise UsageError(
                f"--force {text}: a mode has more than 0 Hz and between 0 and 100 per cent of "
                "critical damping"
            )
        found.append((frequency, percent / 100))
    return tuple(found)


def _say(result: Result) -> None:
    for text in (*remarks(result), *(row.words for row in result.summary.solid)):
        SCREEN.say(text)


def _print(summary: ModesFile) -> None:
    typer.echo(
        "mode  frequency/Hz       sd  damping/%       sd  collinearity  orders  compared/Hz   MAC"
    )
    for number, row in enumerate(summary.modes, start=1):
        orders = "-" if row.orders is None else str(row.orders)
        other = "-" if row.other is None else f"{row.other:.2f}"
        alike = "-" if row.other_mac is None else f"{row.other_mac:.2f}"
        typer.echo(
            f"{number:4d}  {row.frequency:12.3f}  {row.frequency_sd:7.4f}  "
            f"{100 * row.damping:9.3f}  {100 * row.damping_sd:7.4f}  "
            f"{row.phase_collinearity:12.3f}  {orders:>6}  {other:>11}  {alike:>4}"
        )
    beside = f" and {summary.beside_band} poles beside it" if summary.beside_band else ""
    SCREEN.say(
        f"{len(summary.modes)} modes in {summary.band[0]:g}..{summary.band[1]:g} Hz{beside}; what "
        f"remains is {summary.misfit:.3g} times the variance of the noise"
    )
