"""Plants of which one is true: with the causes of a diagnosis, without them, and with others."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.words import InputError, shorten_names
from mbmodel import FrfRequest, MjcfLack
from mbw.predict.machines import MachineRequest, load_machines
from mbw.results.diagnosed_files import read_result
from mbw.results.rivals import rival_names
from tuning import ParameterPosterior, PosteriorOfModel, read_posterior
from tuning.files.plant_folder import AUGMENTED, read_plant_row
from tuning.plant import AlternativePlants, FrfBands, frf_bands


def read_alternatives(
    request: MachineRequest,
    diagnosed: Path | None,
    posterior: PosteriorOfModel,
    frfs: FrfRequest,
    bands: FrfBands,
) -> AlternativePlants | None:
    """Return the plants that are probable, with their probabilities.

    Beside the plant of a diagnosis these are the ones that it wrote, each with its own posterior.
    Beside that of a tuning it is the one with the established causes of ``diagnosed``. It has the
    relative spread of the tuning's parameters, and the causes are present with the probability of
    the least probable one.

    Args:
        request: the machine whose bands are given, its state, and what is put on it.
        diagnosed: folder of ``mbw diagnose`` that the user names beside a tuning; None for none.
        posterior: posterior of the machine.
        bands: bands of the machine.

    Returns:
        None without an alternative.

    Raises:
        InputError: no diagnosis, no established cause, or a port that an alternative lacks.
    """
    if diagnosed is not None and request.path.name != AUGMENTED:
        return _with_diagnosis(request, diagnosed, posterior, frfs, bands)
    row = read_plant_row(request.path)
    if row is None or not row.alternatives:
        return None
    further = []
    for each in row.alternatives:
        file = request.path.with_name(each.file)
        further.append(_bands_of(request, file, read_posterior(file.with_suffix(".npz")), frfs))
    weights = np.array([row.probability, *(each.probability for each in row.alternatives)])
    names = row.name, *(each.name for each in row.alternatives)
    return AlternativePlants(names, weights / weights.sum(), (bands, *further))


def _with_diagnosis(
    request: MachineRequest,
    folder: Path,
    posterior: PosteriorOfModel,
    frfs: FrfRequest,
    bands: FrfBands,
) -> AlternativePlants:
    """Return the tuned plant and the one with the established causes of a diagnosis."""
    result = read_result(folder)
    causes = [result.verdict.causes[row.cause] for row in result.shown.established]
    if not causes:
        raise InputError(f"{folder} established no cause: there is no alternative plant")
    present = min(cause.probability for cause in causes)
    names = "+".join(f"{cause.effect}@{cause.location}" for cause in causes)
    augmented = _bands_of(request, folder / AUGMENTED, posterior.posterior, frfs, is_moved=True)
    return AlternativePlants(("tuned", names), np.array([1 - present, present]), (bands, augmented))


def _bands_of(
    request: MachineRequest,
    file: Path,
    posterior: ParameterPosterior,
    frfs: FrfRequest,
    *,
    is_moved: bool = False,
) -> FrfBands:
    """Return the bands of another MJCF in the state of a machine, with what is put on it.

    Args:
        request: the machine.
        file: the other MJCF.
        posterior: posterior of its parameters.
        is_moved: whether the posterior is that of another model, whose spread it has.
    """
    with load_machines(replace(request, path=file)) as machines:
        model = machines.whole
        return frf_bands(posterior.moved_to(model) if is_moved else posterior.on(model), frfs)


def alternatives_sentence(
    plants: AlternativePlants, folder: Path | None, points: Collection[str]
) -> str:
    """Return which plants there are, what the tuned one stands for, and what the other one lacks.

    Where other causes than the established ones may be there, the tuned plant has their
    probability, unless their own plants are listed.

    Gains and places of sensors and hits are no part of a plant, and are not named.

    Args:
        plants: the alternatives.
        folder: folder of the diagnosis that the user names; None for the plants of its own.
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
