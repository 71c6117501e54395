"""Files of the plant: bands, samples, uncertain plant and weight."""

from pathlib import Path

import numpy as np

from identification.words import InputError, Real
from mbmodel import FrfRequest, Machine, export_state_space
from mbw.named_arrays import write_named_arrays
from mbw.predict.plant_state_space import port_texts
from mbw.predict.schema import UncertainPlantRow, WeightRow
from tuning import PosteriorOfModel
from tuning.files.plant_folder import read_held_out
from tuning.plant import (
    AlternativePlants,
    FrfBands,
    assemble_uncertain_plant,
    bound_magnitudes,
    measure_lft_error,
    sample_frfs,
)
from tuning.plant.uncertainty.multiplicative_error import has_one_input_unit, held_out_input_error

BANDS_NPZ, SAMPLES_NPZ = "bands.npz", "samples.npz"
WEIGHT_NPZ, WEIGHT_MAT = "weight.npz", "weight.mat"
_ERROR_SAMPLES = 20  # of the posterior at which the error of the uncertain plant is measured


def write_uncertain_plant(
    posterior: PosteriorOfModel, frfs: FrfRequest, target: Path, seed: int
) -> UncertainPlantRow:
    """Write the uncertain plant to its file; return its size, and its error at samples.

    Raises:
        InputError: the file cannot be written.
    """
    plant = assemble_uncertain_plant(posterior, frfs)
    samples = posterior.posterior.draw(_ERROR_SAMPLES, seed)
    error = measure_lft_error(plant, posterior, frfs, samples)
    arrays = {
        "A": plant.a,
        "B": plant.b,
        "C": plant.c,
        "D": plant.d,
        "ranks": plant.ranks,
        "is_exact": plant.is_exact,
        "is_relative": plant.is_relative,
        "scale": plant.scale,
        "root": plant.root,
        "deviation": plant.deviation,
        "chi_square": np.array(posterior.posterior.chi_square()),
        "error": np.array(error),
    }
    texts = {"blocks": plant.names, **port_texts(posterior.model.machine, frfs)}
    write_named_arrays(target, arrays, texts)
    return UncertainPlantRow(
        blocks=len(plant.names),
        exact_blocks=int(plant.is_exact.sum()),
        width=plant.width,
        states=len(plant.a),
        max_error=error,
        samples=_ERROR_SAMPLES,
    )


def write_bands(
    machine: Machine,
    bands: FrfBands,
    interval: tuple[Real, Real],
    plants: AlternativePlants | None,
    target: Path,
) -> None:
    """Write FRFs with their intervals.

    Args:
        machine: with its motors and joints.
        bands: FRFs of the tuned model.
        interval: ends of the 95 % interval of the magnitudes, over all alternatives.
        plants: alternatives; None without any.
        target: the file.

    Raises:
        InputError: the file cannot be written.
    """
    low, high = interval
    arrays = {
        "freq_hz": bands.request.freq_hz,
        "frf": bands.values,
        "low": low,
        "high": high,
        "magnitude_deviation": bands.magnitude_deviation,
        "phase_deviation": np.where(bands.values == 0, 0.0, bands.phase_deviation),
        "model_error": bands.model_error,
    }
    texts = port_texts(machine, bands.request)
    if plants is not None:
        arrays["alternative_frf"] = np.array([band.values for band in plants.bands])
        arrays["weights"] = plants.weights
        texts["alternatives"] = list(plants.names)
    write_named_arrays(target, arrays, texts)


def write_samples(
    posterior: PosteriorOfModel, frfs: FrfRequest, count: int, seed: int, target: Path
) -> None:
    """Write samples of the posterior: parameters, FRFs and state spaces.

    Raises:
        InputError: the file cannot be written, or the samples differ in their number of states.
    """
    model, thetas = posterior.model, posterior.sample(count, seed)
    systems = [export_state_space(model, theta, frfs).system for theta in thetas]
    if len({system.nstates for system in systems}) > 1:
        raise InputError(
            "losses or delays need different numbers of states at different samples: leave out "
            "--samples, or the laws"
        )
    arrays = {
        "freq_hz": frfs.freq_hz,
        "parameters": thetas[:, posterior.indices],
        "frf": sample_frfs(posterior, thetas, frfs),
        **{name: np.array([getattr(system, name) for system in systems]) for name in "ABCD"},
    }
    texts = {
        "parameter_names": posterior.posterior.parameters,
        "states": systems[0].state_labels,
        **port_texts(model.machine, frfs),
    }
    write_named_arrays(target, arrays, texts)


def write_weight(mjcf: Path, order: int, place: Path) -> WeightRow:
    """Write the weight of the input error for Python and MATLAB.

    Args:
        mjcf: MJCF of the tuning or diagnosis.
        order: of the filter.
        place: folder of the files.

    Raises:
        InputError: a file cannot be written, or the fit has no held-out predictions.
        UsageError: an order that cannot be used.
    """
    result = read_held_out(mjcf)
    error = held_out_input_error(result)
    weight = bound_magnitudes(error.freq_hz, error.quantile, order)
    numerator, denominator = weight.polynomials()
    arrays = {
        "freq_hz": error.freq_hz,
        "error": error.quantile,
        "errors": error.errors,
        "zeros": weight.zeros,
        "poles": weight.poles,
        "gain": np.array(weight.gain),
        "numerator": numerator,
        "denominator": denominator,
    }
    for name in (WEIGHT_NPZ, WEIGHT_MAT):
        write_named_arrays(place / name, arrays, {"quantity": "multiplicative input error"})
    return WeightRow(
        order=order,
        ratio=weight.ratio,
        median=float(np.median(error.quantile)),
        largest=float(error.quantile.max()),
        quantile=error.probability,
        has_one_unit=has_one_input_unit(result.levels["sensors"]),
    )
