"""``mbw tune --modes``: tuning of a model to a table of modes without shapes."""

import math
from collections.abc import Sequence
from pathlib import Path

import typer

from identification.readers.mode_table import read_mode_table
from identification.readers.result_files import json_text
from identification.words import UsageError
from identification.words.file_access import check_file
from mbmodel import load_machine, refuse_difference
from mbw.files import write_json
from mbw.interrupts import INTERRUPTED
from mbw.messages import NOT_CONVERGED, SCREEN
from mbw.option_texts import read_assignment
from mbw.output_folder import ResultOptions
from mbw.remarks import describe_not_in_mjcf, describe_search
from mbw.tune.mode_pairs import pair_lines
from mbw.tune.mode_table_page import MODE_TABLE_PAGE, render
from tuning.files.mode_table_result import (
    MISSED_SD,
    MODE_TABLE_CSV,
    MODE_TABLE_JSON,
    REACHED_SD,
    missed_rows,
    write_mode_table_result,
)
from tuning.files.posterior_file import POSTERIOR_NPZ
from tuning.files.result import TUNED_MJCF
from tuning.files.schema import ModeTableFile
from tuning.mode_table_tuning import tune_to_modes

NAMES = (MODE_TABLE_JSON, MODE_TABLE_CSV, TUNED_MJCF, POSTERIOR_NPZ, MODE_TABLE_PAGE)
_MAX_LISTED_PARAMETERS = 12  # that the terminal names as determined


def run(
    source: Path,
    outputs: ResultOptions,
    *,
    modes: Path,
    prior: list[str],
    complete_below: float | None,
    misplaced: Sequence[str],
    starts: int | None,
    seed: int,
) -> None:
    """Tune the model, write the result, print the table beside the modes of the model.

    ``mbw.tune.options`` describes the options.

    Raises:
        typer.Exit: the fit was interrupted (code 130), did not converge or misses a row (code 4).
    """
    if misplaced:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in misplaced)
        raise UsageError(f"{names} cannot be combined with --modes: a table of modes has no FRFs")
    if source.is_dir():
        raise UsageError(
            f"{source} is a folder: with --modes, name the MJCF of a machine, such as "
            f"{source / 'model.xml'}"
        )
    if complete_below is not None and not 0 < complete_below < math.inf:
        raise UsageError(f"--complete-below {complete_below:g}: give a frequency in Hz above 0")
    priors = [_parse_prior(text) for text in prior]
    check_file(modes, "name a CSV file with the columns frequency, damping, body, direction")
    table, machine = read_mode_table(modes), load_machine(source)
    with outputs.open("tune", source, "tuned", NAMES) as output:
        with SCREEN.status(f"tuning {machine.name} to {len(table.modes)} modes"):
            tuned = tune_to_modes(
                machine, table, priors, complete_below_hz=complete_below, starts=starts, seed=seed
            )
        with output.write() as place:
            summary = write_mode_table_result(tuned, place)
            if outputs.pictures:
                (place / MODE_TABLE_PAGE).write_text(render(summary), encoding="utf-8")
        write_json(json_text(summary), outputs.json)
        _say(summary, output.path, outputs)
    refuse_difference(TUNED_MJCF, summary.mjcf_difference)
    if summary.fit.outcome == "interrupted":
        SCREEN.error("interrupted: the best parameters so far are written")
        raise typer.Exit(INTERRUPTED)
    if not summary.fit.converged:
        SCREEN.error(f"not converged, {summary.fit.outcome}: {summary.fit.advice}")
    if not summary.fit.converged or missed_rows(summary.modes, MISSED_SD):
        raise typer.Exit(NOT_CONVERGED)


def _parse_prior(text: str) -> tuple[str, float]:
    """Return the pattern and the standard deviation of a text ``NAME=SD``."""
    form = "NAME=SD, such as '*.stiffness=0.5', with SD of 0 or more"
    name, deviation = read_assignment("--prior", text, form)
    if deviation < 0:
        raise UsageError(f"--prior {text!r}: write {form}")
    return name, deviation


def _say(summary: ModeTableFile, folder: Path, outputs: ResultOptions) -> None:
    SCREEN.say(_describe_rows(summary))
    SCREEN.say(describe_search(summary.fit))
    if outputs.has_tables:
        typer.echo("\n".join(pair_lines(summary.modes)))
    SCREEN.say(_describe_determined(summary))
    missing = describe_not_in_mjcf(summary.not_held_by_mjcf, None, MODE_TABLE_JSON)
    for remark in filter(None, [missing, *summary.remarks]):
        SCREEN.say(f"  {remark}")
    SCREEN.say(f"results in {folder}")
    outputs.say_page(folder / MODE_TABLE_PAGE)


def _describe_rows(summary: ModeTableFile) -> str:
    """Return how many rows the tuned model reaches, with the frequencies of the others."""
    missed, count = missed_rows(summary.modes, REACHED_SD), len(summary.modes)
    text = f"{count - len(missed)} of {count} rows are reached within their standard deviation"
    if not missed:
        return text
    listed = ", ".join(f"{row.frequency:.5g}" for row in missed)
    return f"{text}; not those of {listed} Hz: search on with --starts, or widen a prior"


def _describe_determined(summary: ModeTableFile) -> str:
    """Return how many parameters the table determines, with the names of the best ones."""
    rows = sorted((row for row in summary.parameters if row.seen), key=lambda row: row.ratio or 0.0)
    text = (
        f"the table determines {len(rows)} of {len(summary.parameters)} parameters to less than "
        "half of their prior's standard deviation"
    )
    if not rows:
        return f"{text}; the others stay near the nominal model"
    more = len(rows) - _MAX_LISTED_PARAMETERS
    listed = ", ".join(row.name for row in rows[:_MAX_LISTED_PARAMETERS])
    listed += f" and {more} more" if more > 0 else ""
    return f"{text}, best first: {listed}; the others stay near the nominal model"
