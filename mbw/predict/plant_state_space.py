"""State space of the plant as the options ask for it, and its file."""

from pathlib import Path

import numpy as np

from mbmodel import FrfRequest, Machine, Model, input_unit, output_unit
from mbw.named_arrays import write_named_arrays
from mbw.predict.plant_request import PlantRequest
from mbw.predict.schema import ReductionRow
from tuning.plant import ControlPlant, FrfBands, make_control_plant


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
        machine: with its motors and joints.
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
