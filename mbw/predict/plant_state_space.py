"""State space of the plant: reduced, with delays of the inputs, in continuous or discrete time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.words import Real
from mbmodel import (
    FrfBands,
    FrfRequest,
    Machine,
    Model,
    ReducedSystem,
    SampledSystem,
    SystemMatrices,
    discretise,
    export_state_space,
    input_unit,
    output_unit,
    reduce_system,
)
from mbmodel.export.branch_states import ApproximatedLaw
from mbmodel.reduction.order_choice import reduce_by_bound, reduce_within_interval
from mbw.predict.named_arrays import write_named_arrays
from mbw.predict.plant_request import PlantRequest
from mbw.predict.schema import ReductionRow


@dataclass(frozen=True, eq=False)
class PlantStateSpace:
    """State space of the plant with its names.

    Args:
        system: A, B, C, D.
        states: names of the states.
        laws: laws of springs that it approximates.
        delays_s: of the inputs, which A, B, C, D do not hold [s]; (n_in,).
        period_s: sampling period, 0 in continuous time [s].
        reduction: error of the reduction; None for the whole state space.
    """

    system: SystemMatrices
    states: tuple[str, ...]
    laws: tuple[ApproximatedLaw, ...]
    delays_s: Real
    period_s: float = 0.0
    reduction: ReductionRow | None = None


def plant_state_space(
    model: Model, frfs: FrfRequest, request: PlantRequest, bands: FrfBands | None
) -> PlantStateSpace:
    """Return the state space that the options ask for.

    Args:
        model: at its nominal parameters.
        frfs: outputs, inputs and quantity; the lines are the band of reduction and laws.
        request: reduction, delays and sampling period.
        bands: of the FRFs, which choose the order; None without a fit.

    Raises:
        UsageError: delays or an order that cannot be used.
    """
    export = export_state_space(model, model.drawn, frfs)
    whole = SystemMatrices(
        *(np.asarray(getattr(export.system, name), float) for name in ("A", "B", "C", "D"))
    )
    inputs = [str(label) for label in frfs.inputs]
    plant = PlantStateSpace(
        whole, tuple(export.system.state_labels), export.laws, request.delays_of(inputs)
    )
    method = request.method
    if method is not None:
        reduction = reduce_system(whole, frfs.freq_hz, method)
        if request.order is not None:
            reduced = reduction.at(reduction.terms_of(request.order))
        elif bands is not None:
            low, high = bands.magnitude_interval()
            half = np.maximum(high - low, 0) / 2
            reduced = reduce_within_interval(reduction, frfs.freq_hz, bands.values, half)
        else:
            reduced = reduce_by_bound(reduction)
        plant = _reduce(plant, reduced, frfs)
    return plant if request.period_s is None else _sample(plant, request.period_s, inputs)


def _reduce(plant: PlantStateSpace, reduced: ReducedSystem, frfs: FrfRequest) -> PlantStateSpace:
    """Return the reduced plant with its error in the band."""
    moving = frfs.freq_hz > 0
    laplace = np.asarray(2j * np.pi * frfs.freq_hz[moving], complex)
    whole = plant.system.at(laplace)
    peaks = np.abs(whole).max(axis=0, initial=0.0)
    units = np.where(peaks > 0, peaks, 1.0)
    error = np.abs(reduced.system.at(laplace) - whole).max(axis=0, initial=0.0)
    row = ReductionRow(
        method=reduced.reduction.method,
        states=reduced.system.order,
        whole_states=plant.system.order,
        kept_states=reduced.reduction.remainder.order,
        bound=float((reduced.bound / units).max()),
        max_error=float((error / units).max()),
    )
    names = [f"reduced_{k + 1}" for k in range(reduced.system.order)]
    return PlantStateSpace(reduced.system, tuple(names), plant.laws, plant.delays_s, 0.0, row)


def _sample(plant: PlantStateSpace, period: float, inputs: Sequence[str]) -> PlantStateSpace:
    """Return the plant in discrete time, whose states hold the delays."""
    sampled: SampledSystem = discretise(plant.system, period, plant.delays_s)
    late = [f"{inputs[number]}[k-{age}]" for number, age in sampled.delay_states]
    return PlantStateSpace(
        sampled.system,
        (*plant.states, *late),
        plant.laws,
        0 * plant.delays_s,
        period,
        plant.reduction,
    )


def write_plant(plant: PlantStateSpace, machine: Machine, frfs: FrfRequest, target: Path) -> None:
    """Write A, B, C, D with names, units, quantity, sampling period and delays.

    Args:
        plant: the state space.
        machine: with its motors and joints.
        frfs: outputs, inputs and quantity.
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
    write_named_arrays(target, arrays, {"states": plant.states, **port_texts(machine, frfs)})


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
