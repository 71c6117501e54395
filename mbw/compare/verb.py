"""``mbw compare``: modes and FRFs of tests beside each other, and the diagnosis of a change.

Terminal output of ``mbw compare``: modes of the tests, and FRFs that differ most.
"""

from collections.abc import Sequence
from pathlib import Path

import typer

from diagnosis import Verdict
from identification.comparison import TestComparison, compare_tests, name_campaigns
from identification.readers.campaign_toml import find_campaign_file
from identification.readers.result_files import read_result_json
from identification.words import Campaign, InputError, UsageError, percent_text
from mbmodel import Machine
from mbw.any_campaign import open_any_campaign
from mbw.compare.page import render
from mbw.compare.result import NAMES, PAGE, add_verdict, collect_result, write_result
from mbw.compare.schema import ComparedFile, Kind, ScatterRow, ShiftRow
from mbw.diagnose import verb as diagnose
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, OutputRequest, ResultOptions, open_output_folder
from mbw.results.diagnosed_files import PAGE as DIAGNOSIS_PAGE
from tuning.files.plant_folder import DIAGNOSE_VERB, VERDICT
from tuning.files.states_campaign import CAMPAIGN, find_differences, write_states_campaign

BOTH, DIAGNOSED = "both", "diagnosed"  # folders in that of the result
_Opened = tuple[Path, Machine | None, Campaign]


def list_campaigns(paths: Sequence[Path]) -> list[Path]:
    """Return the folders of the campaigns: those that are named, or those in a named folder.

    Raises:
        InputError: there are fewer than two, or one of them has no campaign.toml.
        UsageError: one campaign is named twice.
    """
    folders = list(paths)
    if len(paths) == 1:
        if not paths[0].is_dir() or (paths[0] / CAMPAIGN).exists():
            raise InputError(
                f"{paths[0]} is compared with nothing: name two campaigns, or a folder of campaigns"
            )
        folders = sorted(path.parent for path in paths[0].glob(f"*/{CAMPAIGN}"))
        if len(folders) < 2:
            raise InputError(
                f"{paths[0]} holds {len(folders)} campaigns, folders with a {CAMPAIGN}: name a "
                "folder of two or more"
            )
    if len({find_campaign_file(path).resolve() for path in folders}) < len(folders):
        raise UsageError("a campaign is named twice: name each of them once")
    return folders


def run(
    campaigns: list[Path],
    outputs: ResultOptions,
    *,
    band: tuple[float, float] | None,
    two_machines: bool,
    diagnosis: bool,
    jobs: int,
    resume: bool,
) -> Path:
    """Compare the tests, diagnose the change, write the result and its page.

    Args:
        campaigns: folders of the campaigns, the first before a change; or the folder of a fleet.
        band: lowest and highest frequency [Hz]; None for the frequency lines with coherence.
        two_machines: whether two campaigns are of two machines of one drawing.
        diagnosis: whether the change is diagnosed.
        jobs: number of processes of the diagnosis.
        resume: whether an interrupted diagnosis is continued.

    Returns:
        The folder of the result.

    Raises:
        InputError: a campaign cannot be used.
        UsageError: one is named twice, or more than two are called two machines.
    """
    folders = list_campaigns(campaigns)
    kind: Kind = "fleet" if len(folders) > 2 else "machines" if two_machines else "visits"
    if kind == "fleet" and two_machines:
        raise UsageError("--two-machines is for two campaigns: more are a fleet without it")
    whole = campaigns[0] if len(campaigns) == 1 else None
    names = name_campaigns(folders)
    with SCREEN.status("reading and checking the tests"):
        opened = [open_any_campaign(folder, band) for folder in folders]
    tests, remarks = _choose_tests([campaign for _, _, campaign in opened], names)
    suffix = "compared" if kind == "fleet" or whole else f"{names[1]}-compared"
    with outputs.open("compare", whole or opened[0][0], suffix, NAMES) as output:
        with SCREEN.status("modes of all tests"):
            comparison = compare_tests(tests, names)
        reason: str | None = "no diagnosis, as --no-diagnosis asks"
        if diagnosis:
            reason = _find_reason(opened, comparison, kind)
        result = collect_result(comparison, [each[0] for each in opened], kind, remarks)
        result.without_diagnosis = reason
        _write(result, comparison, output, outputs)
        if outputs.has_tables:
            print_result(result)
        if reason is None:
            verdict = _diagnose(folders, output, outputs, kind, band=band, jobs=jobs, resume=resume)
            result = add_verdict(result, verdict)
            _write(result, comparison, output, outputs)
    write_json(result.model_dump_json(indent=1), outputs.json)
    for text in (*result.remarks, result.sentence, result.change or reason or ""):
        if text:
            SCREEN.say(text)
    SCREEN.say(f"comparison in {output.path}")
    outputs.say_page(output.path / PAGE)
    return output.path


def _choose_tests(
    campaigns: Sequence[Campaign], names: Sequence[str]
) -> tuple[list[Campaign], list[str]]:
    """Return the tests of the first machine of each campaign, and the remarks on all tests."""
    chosen, remarks = [], []
    for campaign, name in zip(campaigns, names, strict=True):
        variants = sorted(campaign.variants, key=bool)
        if len(variants) > 1:
            remarks.append(
                f"{name}: tests with {', '.join(variants[1:])} have modes of their own and are "
                "left out of modes and FRFs"
            )
        chosen.append(campaign.select_variant(variants[0]))
        remarks += [f"{name}: {text}" for text in campaign.remarks]
    return chosen, remarks


def _find_reason(opened: Sequence[_Opened], comparison: TestComparison, kind: Kind) -> str | None:
    """Return why a change cannot be diagnosed; None if it can."""
    if kind == "fleet":
        return "a fleet is not diagnosed: compare two of its campaigns to find what changed"
    for source, machine, _ in opened:
        if machine is None:
            return f"a change can only be named with a model, and {source} names a layout alone"
    first, second = (source for source, _, _ in opened)
    if keys := find_differences(first, second):
        return (
            f"no diagnosis of the change: beside the tests, {first} and {second} differ in "
            f"{', '.join(keys)}; make them agree"
        )
    frfs = [campaign.tests[0].estimate.frf for _, _, campaign in opened]
    if frfs[0].quantity != frfs[1].quantity:
        stated = " and ".join(
            f"{name} {frf.quantity}" for name, frf in zip(comparison.names, frfs, strict=True)
        )
        return f"no diagnosis of the change: {stated} are two quantities; export one"
    if not len(comparison.common_hz):
        return (
            "no diagnosis of the change: the tests have no common frequency axis; export one, or "
            "state one block_s"
        )
    return None


def _diagnose(
    folders: Sequence[Path],
    output: OutputFolder,
    outputs: ResultOptions,
    kind: Kind,
    *,
    band: tuple[float, float] | None,
    jobs: int,
    resume: bool,
) -> Verdict:
    """Write the campaign of both tests, and return the verdict of its diagnosis.

    Raises:
        InputError: a folder cannot be written.
    """
    both, source = output.path / BOTH, output.request.source
    request = OutputRequest("compare", source, both, (CAMPAIGN,), outputs.overwrite)
    with open_output_folder(request) as target, target.write() as place:
        first, second = folders
        write_states_campaign(first, second, place, both, two_machines=kind == "machines")
    SCREEN.say(f"both tests as one campaign in {both}")
    result = ResultOptions(
        output.path / DIAGNOSED, overwrite=outputs.overwrite, pictures=outputs.pictures
    )
    folder = diagnose.run(both, result, band=band, jobs=jobs, resume=resume)
    return read_result_json(folder / VERDICT, Verdict, DIAGNOSE_VERB)


def _write(
    result: ComparedFile,
    comparison: TestComparison,
    output: OutputFolder,
    outputs: ResultOptions,
) -> None:
    """Write the files of the result, and its page if it is wanted."""
    with output.write() as place:
        write_result(result, place)
        if outputs.pictures:
            report = f"{DIAGNOSED}/{DIAGNOSIS_PAGE}" if result.verdict is not None else None
            page = render(result, comparison, report)
            (place / PAGE).write_text(page, encoding="utf-8")


_MAX_LISTED_FRFS = 5


def print_result(result: ComparedFile) -> None:
    """Print the modes, and the FRFs that differ most."""
    (_print_fleet if result.kind == "fleet" else _print_pair)(result)
    for row in result.frfs[:_MAX_LISTED_FRFS]:
        typer.echo(
            f"FRF {row.output} / {row.input}: difference {row.over_noise:.3g} times the noise, "
            f"{percent_text(row.relative)} of the FRF"
        )


def _print_pair(result: ComparedFile) -> None:
    """Print frequency and damping of both tests, the second less the first in its deviations."""
    typer.echo(
        "mode  frequency/Hz      second  shift/%       sd     sigma  damping/%  second     sigma  "
        " MAC  changed"
    )
    for number, row in enumerate(result.modes, start=1):
        frequency = _shift_cells(row.frequency, row.frequency_shift)
        sigma = None if row.damping_shift is None else row.damping_shift.significance
        pairs = (("frequency", row.frequency_shift), ("damping", row.damping_shift))
        changed = [name for name, shift in pairs if shift is not None and shift.changed]
        percents = [None if value is None else 100 * value for value in row.damping]
        typer.echo(
            f"{number:4d}  {_cell(row.frequency[0], 12, '.3f')}  "
            f"{_cell(row.frequency[1], 10, '.3f')}  {frequency}  "
            f"{_cell(percents[0], 9, '.3f')}  {_cell(percents[1], 6, '.3f')}  "
            f"{_sigma_cell(sigma)}  "
            f"{_cell(row.mac[1] if row.frequency_shift else None, 4, '.2f')}  "
            f"{', '.join(changed) or '-'}"
        )


def _shift_cells(values: list[float | None], shift: ShiftRow | None) -> str:
    """Return a shift and its deviation relative to the first value, and their ratio."""
    first = values[0]
    if shift is None or not first:
        return f"{'-':>7}  {'-':>7}  {_sigma_cell(None)}"
    share = 100 / abs(first)
    return (
        f"{share * shift.value:+7.3f}  {share * shift.sd:7.4f}  {_sigma_cell(shift.significance)}"
    )


def _sigma_cell(value: float | None) -> str:
    """Return a shift over its deviation, in the eight characters of 1.23e+04."""
    return _cell(value, 8, ".3g")


def _print_fleet(result: ComparedFile) -> None:
    """Print mean, spread between tests and deviation within a test of each mode."""
    typer.echo(
        "mode   found   mean/Hz  spread/%  within/%  damping/%  spread/%  within/%  stands out"
    )
    for number, row in enumerate(result.modes, start=1):
        count = f"{sum(value is not None for value in row.frequency)}/{len(result.campaigns)}"
        scatters = [each for each in (row.frequency_scatter, row.damping_scatter) if each]
        names = list(dict.fromkeys(name for each in scatters for name in each.stands_out))
        cells = [
            _scatter_cells(each, *unit)
            for each, unit in zip(scatters, ((1.0, 8), (100.0, 9)), strict=True)
        ]
        typer.echo(f"{number:4d}  {count:>6}  {'  '.join(cells)}  {', '.join(names) or '-'}")


def _scatter_cells(scatter: ScatterRow, unit: float, width: int) -> str:
    """Return mean, spread and deviation within a test, both relative to the mean."""
    share = 100 / abs(scatter.mean) if scatter.mean else 0.0
    spread = None if scatter.spread is None else share * scatter.spread
    return (
        f"{unit * scatter.mean:{width}.3f}  {_cell(spread, 8, '.3g')}  "
        f"{_cell(share * scatter.within, 8, '.3g')}"
    )


def _cell(value: float | None, width: int, style: str) -> str:
    """Return a number in a column, or a dash."""
    return f"{'-' if value is None else format(value, style):>{width}}"
