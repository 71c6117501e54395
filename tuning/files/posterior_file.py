"""posterior.npz: posterior of the machine's parameters after a fit, for ``mbw predict``.

The measurement's own parameters (gains, angles, positions of sensors and hammer) are integrated
out: a plant from motor to encoder has none of them.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from identification.readers.result_files import read_result_arrays, write_result_arrays
from identification.words import InputError, Integers, Real
from mbmodel import Model
from tuning.assessment.effect_slopes import EffectSlopes
from tuning.assessment.parameter_posterior import ParameterPosterior
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.toleranced_model import MACHINE_LOCATIONS

POSTERIOR_NPZ = "posterior.npz"


def machine_posterior(
    model: Model,
    parametrisation: Parametrisation,
    x: Real,
    covariance: Real,
    error_floor: float | None = None,
    discrepancy: float = 0.0,
    *,
    held: Mapping[str, float] | None = None,
    effects: EffectSlopes | None = None,
) -> ParameterPosterior:
    """Return the posterior of the machine's parameters.

    Args:
        x: coordinates at its end; (n_x,).
        covariance: of all coordinates; (n_x, n_x).
        error_floor: relative error of the model beside the noise; None if it shows none.
        discrepancy: relative error of the machine's forces; 0 if none shows.
        held: parameters that the MJCF of the machine has, by name; None for all. Its springs count
            as they are there: a change of one has the relative deviation of the spring.
        effects: what parameters of effects change of that machine; None without effects.
    """
    is_of_machine = np.array(
        [location.startswith(MACHINE_LOCATIONS) for location in model.locations], bool
    )
    if held is not None:
        plant_names = {*held, *(() if effects is None else effects.names)}
        is_of_machine = np.array([each.name in plant_names for each in model.parameters], bool)
    indices = np.flatnonzero(is_of_machine & parametrisation.free)
    kept: Integers = np.unique(parametrisation.coordinate_of[indices])
    values = parametrisation.theta(x)
    for k in indices:
        if held and (each := model.parameters[k]).known in ("stiffness", "damping"):
            values[k] = held.get(each.name, values[k])
    return ParameterPosterior(
        tuple(parametrisation.names[k] for k in kept),
        tuple(model.parameters[k].name for k in indices),
        values[indices],
        np.searchsorted(kept, parametrisation.coordinate_of[indices]),
        parametrisation.scales[kept],
        parametrisation.is_logarithmic[kept],
        covariance[np.ix_(kept, kept)],
        error_floor or 0.0,
        discrepancy,
        effects if effects is not None and effects.names else None,
    )


def write_posterior(posterior: ParameterPosterior, target: Path) -> None:
    """Write posterior.npz."""
    arrays = {
        "names": np.array(posterior.names),
        "parameters": np.array(posterior.parameters),
        "values": posterior.values,
        "coordinate_of": posterior.coordinate_of,
        "scale": posterior.scale,
        "is_logarithmic": posterior.is_logarithmic,
        "covariance": posterior.covariance,
        "error_floor": np.array(posterior.error_floor),
        "discrepancy": np.array(posterior.discrepancy),
    }
    if (effects := posterior.effects) is not None:
        for name in ("names", "coordinates", "bodies", "inertia", "joint"):
            arrays[f"effect_{name}"] = np.array(getattr(effects, name))
    write_result_arrays(target, arrays)


def read_posterior(path: Path) -> ParameterPosterior:
    """Read posterior.npz.

    Args:
        path: the file, or the folder of a tuning or diagnosis.

    Raises:
        InputError: the file is missing, broken or of another version.
    """
    file = path / POSTERIOR_NPZ if path.is_dir() else path
    arrays = read_result_arrays(file, "mbw tune")
    try:
        posterior = ParameterPosterior(
            tuple(map(str, arrays["names"])),
            tuple(map(str, arrays["parameters"])),
            np.asarray(arrays["values"], float),
            np.asarray(arrays["coordinate_of"], np.intp),
            np.asarray(arrays["scale"], float),
            np.asarray(arrays["is_logarithmic"], bool),
            np.asarray(arrays["covariance"], float),
            float(arrays["error_floor"]),
            float(arrays["discrepancy"]),
            _read_effects(arrays),
        )
        _check(posterior)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{file} is broken or of another version: run mbw tune or mbw diagnose again"
        ) from error
    return posterior


def _read_effects(arrays: dict[str, np.ndarray]) -> EffectSlopes | None:
    """Return the slopes by parameters of effects; None without effects."""
    if "effect_names" not in arrays:
        return None
    names, coordinates, bodies = (
        tuple(map(str, arrays[f"effect_{name}"])) for name in ("names", "coordinates", "bodies")
    )
    size = len(coordinates)
    inertia = np.asarray(arrays["effect_inertia"], float)
    joint = np.asarray(arrays["effect_joint"], float)
    is_whole = inertia.shape == (len(names), len(bodies), 6, 6)
    if not (is_whole and joint.shape == (len(names), 3, size, size)):
        raise ValueError("effects")
    return EffectSlopes(names, coordinates, bodies, inertia, joint)


def _check(posterior: ParameterPosterior) -> None:
    """Raise ValueError for arrays that do not fit each other."""
    size, count = posterior.size, len(posterior.parameters)
    covariance, members = posterior.covariance, posterior.coordinate_of
    if covariance.shape != (size, size) or posterior.values.shape != (count,):
        raise ValueError("shapes")
    if posterior.scale.shape != (size,) or posterior.is_logarithmic.shape != (size,):
        raise ValueError("shapes")
    if members.shape != (count,) or set(members.tolist()) != set(range(size)):
        raise ValueError("coordinates")
    if not (np.isfinite(covariance).all() and np.isfinite(posterior.values).all()):
        raise ValueError("numbers")
    if not (0 <= posterior.error_floor < np.inf and 0 <= posterior.discrepancy < np.inf):
        raise ValueError("floor")
