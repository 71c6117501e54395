"""``mbw excite``: signals for drives under their limits, and what they will show."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from identification import correct_layout
from identification.words import UsageError
from mbw.excite.folder import folder_names, write_folder
from mbw.excite.open_causes import design_for_causes, list_open_causes, name_cause
from mbw.excite.page import PAGE, render
from mbw.excite.schema import EXCITATION_JSON
from mbw.excite.summary import describe_excitation, summarise
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions, source_of
from tuning.excitation.limits_toml import read_limits
from tuning.excitation.request import ExcitationOptions, build_request
from tuning.excitation.tested_machine import TestedMachine, design_test, open_tested_machine
from tuning.files.plant_folder import plant_file


def run_options(
    model: Path,
    *,
    stated: Mapping[str, Any],
    key: str | None,
    out: Path | None,
    pictures: bool,
    json: Path | None,
    seed: int,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.excite.options`` describes them."""
    outputs = ResultOptions(out, json, overwrite, pictures)
    tested = _open(model, key)
    options = _read_options(stated, tested)
    request, remarks = build_request(tested.machine, options)
    names = [EXCITATION_JSON, PAGE, *folder_names(tested)]
    with outputs.open("excite", tested.source, "excited", names) as output:
        with SCREEN.status("design of the signals"):
            excitation, tested = design_test(tested, request)
            causes = list_open_causes(model)
            if causes:
                excitation = design_for_causes(excitation, causes)
            names_of_causes = [name_cause(cause) for cause in causes]
            summary = summarise(excitation, (*tested.remarks, *remarks), names_of_causes)
        with output.write() as place:
            write_folder(place, output.path, excitation, tested, seed)
            text = summary.model_dump_json(indent=1)
            (place / EXCITATION_JSON).write_text(text + "\n", encoding="utf-8")
            if pictures:
                (place / PAGE).write_text(render(excitation, summary), encoding="utf-8")
    for sentence in describe_excitation(summary):
        SCREEN.say(sentence)
    SCREEN.say(f"campaign in {output.path}")
    if pictures:
        SCREEN.say(f"pictures: open {(output.path / PAGE).resolve().as_uri()}")
    if not (outputs.has_json_on_stdout or SCREEN.quiet):
        typer.echo(f"mbw tune {output.path}")
    if json is not None:
        write_json(text, json)


def _open(path: Path, key: str | None) -> TestedMachine:
    """Return the machine, with what the campaign states from which a folder of results was made."""
    tested = open_tested_machine(path, key)
    mjcf = plant_file(path)
    source = source_of(path, mjcf.name) if mjcf != path else None
    if source is None or source.suffix != ".toml" or not source.is_file():
        return tested
    stated = open_tested_machine(source, key)
    kept = ("tolerance", "specification", "springs", "drives", "outputs", "settings")
    tested = replace(tested, **{name: getattr(stated, name) for name in kept})
    if tested.settings is None:
        return tested
    layout = correct_layout(source, tested.settings, tested.machine.layout)
    return replace(tested, machine=replace(tested.machine, layout=layout))


def _read_options(stated: Mapping[str, Any], tested: TestedMachine) -> ExcitationOptions:
    """Return what the user states, with the limits of all drives."""
    drives = tested.drives
    if stated["drives"] is not None:  # the numbers of an offset have commas too: ty@0,0,0.2:+tx
        drives = re.split(r",(?=\s*[^\W\d])", stated["drives"])
    options = ExcitationOptions(
        limits={},
        outputs=stated["outputs"] or tested.outputs,
        noise=_read_numbers("--noise", stated["noise"]),
        steps=_read_numbers("--resolution", stated["resolution"]),
        band=stated["band"],
        seconds=stated["seconds"],
        rate_hz=stated["rate_hz"],
        kind=stated["kind"],
        ignored=tested.ignored,
    )
    names = [name.strip() for name in drives]
    if not all(names):
        raise UsageError(f"--drives {stated['drives']!r} names no drive: write NAME,NAME")
    return read_limits(options, stated["limits_file"], stated["limits"], names)


def _read_numbers(option: str, texts: Sequence[str]) -> dict[str, float]:
    """Return the numbers of texts ``LABEL=NUMBER``, by label."""
    numbers = {}
    for text in texts:
        label, _, number = text.rpartition("=")
        try:
            numbers[label] = float(number)
        except ValueError as error:
            raise UsageError(f"{option} {text!r}: write LABEL=NUMBER in SI") from error
    return numbers
