"""``mbw excite``: signals for drives under their limits, and what they will show.

Causes that a diagnosis has left open, for which an excitation is designed.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import typer

from diagnosis import Verdict
from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.verdict.schema import CauseRow
from identification import correct_layout
from identification.readers.result_files import read_result_json
from identification.words import UsageError
from mbmodel.parts import AttachedPart
from mbw.excite.folder import folder_names, write_folder
from mbw.excite.page import PAGE, render
from mbw.excite.schema import EXCITATION_JSON
from mbw.excite.summary import describe_excitation, summarise
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.option_texts import read_assignment
from mbw.output_folder import ResultOptions, source_of
from mbw.results.diagnosed_schema import ShownFile
from tuning import Session
from tuning.excitation.design import Excitation, design_excitation
from tuning.excitation.limits_toml import read_limits
from tuning.excitation.request import ExcitationOptions, build_request
from tuning.excitation.tested_machine import TestedMachine, design_test, open_tested_machine
from tuning.files.plant_folder import DIAGNOSE_VERB, SHOWN, VERDICT, plant_file

_LABEL_FORM = "LABEL=NUMBER in SI"


def run(  # noqa: PLR0913  # one for each option
    model: Path,
    target: ResultOptions,
    *,
    drives: str | None,
    limits: Path | None,
    limit: list[str],
    outputs: list[str],
    noise: list[str],
    resolution: list[str],
    band: tuple[float, float] | None,
    seconds: float,
    rate: float | None,
    kind: str,
    key: str | None,
    seed: int,
) -> None:
    """Run the verb with the values of its options, as ``mbw.excite.options`` describes them."""
    tested = _open(model, key)
    options = ExcitationOptions(
        limits={},
        outputs=outputs or tested.outputs,
        noise=dict(read_assignment("--noise", text, _LABEL_FORM) for text in noise),
        steps=dict(read_assignment("--resolution", text, _LABEL_FORM) for text in resolution),
        band=band,
        seconds=seconds,
        rate_hz=rate,
        kind=kind,
        ignored=tested.ignored,
    )
    options = read_limits(options, limits, limit, _list_drives(drives, tested))
    request, remarks = build_request(tested.machine, options)
    names = [EXCITATION_JSON, PAGE, *folder_names(tested)]
    with target.open("excite", tested.source, "excited", names) as output:
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
            if target.pictures:
                (place / PAGE).write_text(render(excitation, summary), encoding="utf-8")
    for sentence in describe_excitation(summary):
        SCREEN.say(sentence)
    SCREEN.say(f"campaign in {output.path}")
    target.say_page(output.path / PAGE)
    if target.has_tables:
        typer.echo(f"mbw tune {output.path}")
    write_json(text, target.json)


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


def _list_drives(stated: str | None, tested: TestedMachine) -> list[str]:
    """Return the names of the drives: those of ``--drives``, or those of the machine's test."""
    if stated is None:
        return list(tested.drives)
    # The numbers of an offset have commas too: ty@0,0,0.2:+tx.
    names = [name.strip() for name in re.split(r",(?=\s*[^\W\d])", stated)]
    if not all(names):
        raise UsageError(f"--drives {stated!r} names no drive: write NAME,NAME")
    return names


_MIN_OPEN_PROBABILITY = 0.05  # of a cause: rarer ones would take power from the open question


def list_open_causes(folder: Path) -> list[CauseRow]:
    """Return the causes that a verdict names and the plant of its folder does not have.

    Places that the test did not tell apart are a cause each.

    Args:
        folder: folder of ``mbw diagnose``; another path has none.
    """
    if not (folder / VERDICT).is_file():
        return []
    verdict = read_result_json(folder / VERDICT, Verdict, DIAGNOSE_VERB)
    plant = read_result_json(folder / SHOWN, ShownFile, DIAGNOSE_VERB).plant
    plant_name = "" if plant is None else plant.name
    named = [
        row.model_copy(update={"location": place})
        for row in verdict.causes
        if row.probability >= _MIN_OPEN_PROBABILITY
        for place in (row.places or [row.location])
    ]
    return [row for row in named if name_cause(row) not in plant_name]


def name_cause(row: CauseRow) -> str:
    """Return effect and place, such as ``appendage@body:ty``."""
    return f"{row.effect}@{row.location}"


def design_for_causes(excitation: Excitation, causes: Sequence[CauseRow]) -> Excitation:
    """Return an excitation that is designed for the sizes of causes instead of stiffnesses.

    Args:
        excitation: designed for all stiffnesses.
        causes: causes; without a hypothesis of them the excitation stays.
    """
    hypotheses = list(_propose(excitation, causes))
    if not hypotheses:
        return excitation
    hung = [part for part in excitation.model.parts if isinstance(part, AttachedPart)]
    return design_excitation(
        excitation.model.machine,
        excitation.request,
        excitation.campaign.tolerance,
        excitation.specification,
        parts=[*hung, *dict.fromkeys(part for each in hypotheses for part in each.parts)],
        of_interest=list(dict.fromkeys(name for each in hypotheses for name in each.coordinates)),
        unknown_gains=excitation.campaign.unknown_gains,
    )


def _propose(excitation: Excitation, causes: Sequence[CauseRow]) -> Iterator[Hypothesis]:
    """Yield a hypothesis of each cause: of several shapes, the one nearest to what was fitted."""
    machine, catalogue = excitation.model.machine, load_catalogue()
    session = Session(
        machine.source, excitation.model, excitation.campaign, excitation.parametrisation
    )
    scene = Scene(session, excitation.theta)
    proposed = {
        effect: list(catalogue[effect](scene))
        for effect in dict.fromkeys(row.effect for row in causes)
        if effect in catalogue
    }
    for row in causes:
        shapes = [
            hypothesis
            for hypothesis in proposed.get(row.effect, ())
            if hypothesis.location == row.location
            and hypothesis.coordinates
            and hypothesis.reform is None
            and hypothesis.member is None
        ]
        along = [hypothesis for hypothesis in shapes if hypothesis.dof == row.dof]
        if along or shapes:
            yield min(along or shapes, key=lambda each: _distance(each, row, excitation))


def _distance(hypothesis: Hypothesis, row: CauseRow, excitation: Excitation) -> float:
    """Return how far the start of a hypothesis is from a fitted cause, in logarithms of sizes."""
    parameters = [p for part in hypothesis.parts for p in part.parameters]
    start = {p.name: p.drawn for p in (*excitation.model.parameters, *parameters)}
    stated = hypothesis.state({**start, **hypothesis.begin})
    pairs = [(stated.get(name), value) for name, value in row.parameters.items()]
    return sum(
        abs(float(np.log(first / second)))
        for first, second in pairs
        if isinstance(first, float) and isinstance(second, float) and min(first, second) > 0
    )
