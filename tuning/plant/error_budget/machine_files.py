"""Machine of a budget from its MJCF, with the posterior of the tuning that wrote it."""

from pathlib import Path

from mbmodel import Machine, Model, SpringPart, as_drawn, machine_model
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.control_loops.loops_file import LOOPS_JSON
from tuning.files.posterior_file import POSTERIOR_NPZ, read_posterior
from tuning.files.result import FRF_NPZ, TUNED_JSON, TUNED_MJCF, TuningResult, read_result


def tuned_file(path: Path) -> Path:
    """Return the MJCF of a tuning's folder; another path as it is."""
    return path / TUNED_MJCF if path.is_dir() else path


def model_with_posterior(machine: Machine, path: Path) -> tuple[Model, PosteriorOfModel | None]:
    """Return the nominal model of a machine, and its posterior if a tuning wrote it.

    Args:
        machine: from the MJCF.
        path: the MJCF; a ``tuned.xml`` may have a posterior beside it.

    Raises:
        InputError: the posterior is broken or of another machine.
    """
    if path.name != TUNED_MJCF or not (path.parent / POSTERIOR_NPZ).is_file():
        return as_drawn(machine), None
    model = machine_model(machine)
    return model, read_posterior(path.parent).on(model)


def fitted_model(
    machine: Machine, model: Model, path: Path
) -> tuple[Model, PosteriorOfModel | None]:
    """Return a model with its posterior, or the model alone where it is not the fitted one.

    Args:
        machine: whose model is meant; with what is put on it, it is not the fitted one.
        model: its nominal model; laws of its springs beyond the MJCF were not fitted either.
        path: MJCF from which the machine was made.
    """
    has_laws = not all(isinstance(part, SpringPart) for part in model.parts)
    if has_laws or machine.source.name != path.name:
        return model, None
    fitted, posterior = model_with_posterior(machine, path)
    return (model, None) if posterior is None else (fitted, posterior)


def tuning_beside(path: Path) -> TuningResult | None:
    """Return the tuning of FRFs that wrote an MJCF, if its held-out errors are those of the plant.

    Args:
        path: the MJCF.

    Returns:
        None if no such tuning lies beside the MJCF, or if loops were closed during its test: its
        errors are then those of the closed loops.

    Raises:
        InputError: its files are damaged.
    """
    folder = path.parent
    is_there = all((folder / name).is_file() for name in (TUNED_JSON, FRF_NPZ))
    if not is_there or (folder / LOOPS_JSON).is_file():
        return None
    return read_result(folder)
