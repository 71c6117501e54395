"""Machine of a budget from its MJCF, with the posterior of the fit that wrote it."""

from pathlib import Path

from mbmodel import Machine, Model, SpringPart, as_drawn, machine_model
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.files.plant_folder import has_posterior
from tuning.files.posterior_file import read_posterior


def model_with_posterior(machine: Machine, path: Path) -> tuple[Model, PosteriorOfModel | None]:
    """Return the nominal model of a machine, and its posterior if a fit wrote it.

    Args:
        machine: from the MJCF.
        path: the MJCF; that of a tuning or diagnosis may have a posterior beside it.

    Raises:
        InputError: the posterior is broken or of another machine.
    """
    if not has_posterior(path):
        return as_drawn(machine), None
    posterior = read_posterior(path.parent).on(machine_model(machine))
    return posterior.model, posterior


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
