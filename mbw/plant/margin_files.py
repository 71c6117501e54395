"""Loop gains and margins of a budget for python-control and MATLAB."""

from pathlib import Path

import numpy as np

from identification.words import Loop
from mbw.named_arrays import write_named_arrays
from tuning.plant.control_loops.loop_gain_lines import single_loop_gains
from tuning.plant.control_loops.margin_values import LoopMargins
from tuning.plant.error_budget.loop_margins import PlantMargins

MARGINS_NPZ, MARGINS_MAT = "margins.npz", "margins.mat"
_OF_MACHINES = ("gain", "reduction", "phase", "delay", "modulus")


def write_margins(margins: PlantMargins, loops: tuple[Loop, ...], folder: Path) -> None:
    """Write loop gains of the nominal machine, and margins of all machines of the posterior.

    Args:
        margins: of the loops.
        loops: of the budget.
        folder: of the result.

    Raises:
        InputError: a file cannot be written.
    """
    nominal = margins.nominal
    arrays = {
        "freq_hz": nominal.freq_hz,
        "loop_gain": single_loop_gains(nominal.gains),
        "all_loops_gain": nominal.gains,
        "periods": np.array([loop.controller.period_s for loop in loops]),
        **{
            name: np.array(
                [[_value(loop, name) for loop in each.loops] for each in margins.samples]
            ).reshape(len(margins.samples), len(loops))
            for name in _OF_MACHINES
        },
    }
    texts = {
        "loops": margins.names,
        "inputs": [str(loop.input) for loop in loops],
        "input_units": [loop.input_unit for loop in loops],
        "outputs": [str(loop.measured) for loop in loops],
        "output_units": [loop.measured.unit for loop in loops],
    }
    for name in (MARGINS_NPZ, MARGINS_MAT):
        write_named_arrays(folder / name, arrays, texts)


def _value(loop: LoopMargins, name: str) -> float:
    """Return the value of a margin by its name."""
    return float(getattr(loop, name).value)
