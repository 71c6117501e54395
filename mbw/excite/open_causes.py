"""Causes that a diagnosis has left open, for which an excitation is designed."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from diagnosis import Verdict
from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.verdict.schema import CauseRow
from identification.readers.result_files import read_result_json
from mbmodel.parts import AttachedPart
from mbw.results.diagnosed_schema import ShownFile
from tuning import Session
from tuning.excitation.design import Excitation, design_excitation
from tuning.files.plant_folder import DIAGNOSE_VERB, SHOWN, VERDICT

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
