"""Causes of a diagnosis as alternative plants: with them, and as the tuning has it without."""

from collections.abc import Collection
from pathlib import Path

import numpy as np

from identification.words import InputError, shorten_names
from mbmodel import FrfRequest, MjcfLack, load_machine, machine_model, with_loops
from mbw.results.diagnosed_files import AUGMENTED, read_result
from mbw.results.rivals import rival_names
from tuning import PosteriorOfModel
from tuning.plant import AlternativePlants, FrfBands, frf_bands


def read_alternatives(
    folder: Path, posterior: PosteriorOfModel, frfs: FrfRequest, bands: FrfBands
) -> AlternativePlants:
    """Return the tuned plant and the one with the established causes, with their probabilities.

    The augmented plant has the relative spread of the tuning's parameters. The causes are present
    with the probability of the least probable one.

    Args:
        folder: of ``mbw diagnose``.
        posterior: of the tuned model.
        frfs: outputs, inputs and lines.
        bands: of the tuned model.

    Raises:
        InputError: no diagnosis, no established cause, or a port that the augmented model lacks.
    """
    result = read_result(folder)
    causes = [result.verdict.causes[row.cause] for row in result.shown.established]
    if not causes:
        raise InputError(f"{folder} established no cause: there is no alternative plant")
    loops = posterior.model.machine.loops
    model = machine_model(with_loops(load_machine(folder / AUGMENTED), loops))
    present = min(cause.probability for cause in causes)
    names = "+".join(f"{cause.effect}@{cause.location}" for cause in causes)
    augmented = frf_bands(posterior.posterior.moved_to(model), frfs)
    return AlternativePlants(("tuned", names), np.array([1 - present, present]), (bands, augmented))


def alternatives_sentence(
    plants: AlternativePlants, folder: Path | None, points: Collection[str]
) -> str:
    """Return which plants there are, what the tuned one stands for, and what the other one lacks.

    A diagnosis writes the plant of the established causes alone. Where other causes may be there in
    their place, the tuned plant has their probability.

    Gains and places of sensors and hits are no part of a plant, and are not named.

    Args:
        plants: the alternatives.
        folder: of the diagnosis.
        points: names of sensors and hits.
    """
    pairs = zip(plants.names, plants.weights, strict=True)
    listed = ", ".join(f"{name} ({100 * weight:.3g} %)" for name, weight in pairs)
    if folder is None:
        return f"alternative plants: {listed}"
    result = read_result(folder)
    missing = [
        text
        for text in result.shown.not_held_by_mjcf
        if not text.startswith("hammer")
        and MjcfLack.CHANNEL not in text
        and text.split(".", 1)[0] not in points
    ]
    lacks = f"; {AUGMENTED} does not hold {shorten_names(missing)}" if missing else ""
    held = [result.verdict.causes[row.cause] for row in result.shown.established]
    rivals = rival_names(result.verdict, [f"{each.effect}@{each.location}" for each in held])
    stands = (
        f"; the tuned plant stands for {shorten_names(rivals)} too, whose own plant is not computed"
        if rivals
        else ""
    )
    return f"alternative plants: {listed}{stands}{lacks}"
