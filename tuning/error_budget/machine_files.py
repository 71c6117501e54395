"""Machine of a budget from its MJCF, with the posterior of the tuning that wrote it."""

from pathlib import Path

from mbmodel import Machine, Model, PosteriorOfModel, as_drawn, machine_model
from tuning.files.posterior_file import POSTERIOR_NPZ, read_posterior
from tuning.files.result import TUNED_MJCF


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
