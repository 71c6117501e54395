"""Files of the plant: bands, samples, uncertain plant and weight.

State space of the plant as the options ask for it, and its file.
"""

from pathlib import Path

import numpy as np

from identification.words import InputError, Real
from mbmodel import FrfRequest, Machine, Model, export_state_space, input_unit, output_unit
from mbw.files import write_named_arrays
from mbw.predict.plant_request import PlantRequest
from mbw.predict.schema import ReductionRow, UncertainPlantRow, WeightRow
from tuning import PosteriorOfModel
from tuning.files.plant_folder import read_held_out
from tuning.plant import (
    AlternativePlants,
    ControlPlant,
    FrfBands,
    assemble_uncertain_plant,
    bound_magnitudes,
    make_control_plant,
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


def plant_state_space(
    model: Model, frfs: FrfRequest, request: PlantRequest, bands: FrfBands | None
) -> ControlPlant:
    """Return the state space that the options ask for.

    Args:
        model: at its nominal parameters.
        frfs: outputs, inputs and quantity; the lines are the band of reduction and laws.
        request: reduction, delays and sampling period.
        bands: of the FRFs, which choose the order; None without a fit.

    Raises:
        UsageError: delays or an order that cannot be used.
    """
    delays = request.delays_of([str(label) for label in frfs.inputs])
    plant = make_control_plant(model, model.drawn, frfs, delays)
    if request.method is not None:
        plant = plant.reduce(request.method, request.order, bands)
    return plant if request.period_s is None else plant.sample(request.period_s)


def reduction_row(plant: ControlPlant) -> ReductionRow | None:
    """Return the reduction with its errors; None for all states."""
    if plant.reduced is None:
        return None
    reduction = plant.reduced.reduction
    return ReductionRow(
        method=reduction.method,
        states=plant.reduced.system.order,
        whole_states=plant.whole.order,
        kept_states=reduction.remainder.order,
        bound=plant.relative_bound,
        max_error=plant.largest_error,
    )


def write_plant(plant: ControlPlant, machine: Machine, target: Path) -> None:
    """Write A, B, C, D with names, units, quantity, sampling period, delays and closed loops.

    Args:
        plant: the state space.
        target: .npz or .mat.

    Raises:
        InputError: the file cannot be written.
    """
    system = plant.system
    arrays = {
        **dict(zip("ABCD", (system.a, system.b, system.c, system.d), strict=True)),
        "Ts": np.array(plant.period_s),
        "input_delay": plant.delays_s,
    }
    closed = [loop.name for loop in machine.loops]
    texts = {
        "states": plant.states,
        **port_texts(machine, plant.request),
        **({"closed_loops": closed} if closed else {}),
    }
    write_named_arrays(target, arrays, texts)


def port_texts(machine: Machine, frfs: FrfRequest) -> dict[str, list[str] | str]:
    """Return names and units of inputs and outputs, and the quantity."""
    return {
        "inputs": [str(label) for label in frfs.inputs],
        "outputs": [str(label) for label in frfs.outputs],
        "input_units": [input_unit(machine, label) for label in frfs.inputs],
        "output_units": [output_unit(machine, label, frfs.quantity) for label in frfs.outputs],
        "quantity": frfs.quantity,
    }


def reduction_sentence(row: ReductionRow) -> str:
    """Return what the reduction did, and its error."""
    kept = f", {row.kept_states} of rigid or undamped modes kept" if row.kept_states else ""
    return (
        f"state space: {row.method} truncation to {row.states} of {row.whole_states} states{kept}; "
        f"error in the band at most {row.max_error:.2g} of the peak, at every frequency below "
        f"{row.bound:.2g}"
    )
