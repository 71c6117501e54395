"""Stability margins of the loops that ``mbw predict --closed`` closes, without a budget.

Loop gains and margins of a budget for python-control and MATLAB.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.words import InputError, Loop, sampling_period
from mbmodel import Model
from mbw.files import write_named_arrays
from mbw.plant.margin_rows import margins_row
from mbw.plant.margin_schema import MarginsRow
from mbw.plant.margin_sentences import margin_lines
from tuning.plant.control_loops.loop_gain_lines import single_loop_gains
from tuning.plant.control_loops.stability_margins import LoopMargins
from tuning.plant.error_budget.loop_margins import (
    ClosedLoops,
    PlantMargins,
    VariantMargins,
    closed_loops,
    variant_margins,
)
from tuning.plant.error_budget.loop_plant import LoopPlant, loops_alone
from tuning.plant.error_budget.machine_files import FittedMachine
from tuning.plant.variant_model import VariantModel

_MIN_LOW_END_SHARE = 1e-3  # of the upper end of the band, which may begin at 0 Hz


@dataclass(frozen=True, eq=False)
class LoopStudy:
    """Stability of the loops that are closed.

    Args:
        loops: that are closed.
        closed: their stability and margins.
        variants: stability in models and poses of tests.
        refusal: why there are no margins; empty if there are.
    """

    loops: tuple[Loop, ...]
    closed: ClosedLoops
    variants: tuple[VariantMargins, ...]
    refusal: str = ""

    @property
    def row(self) -> MarginsRow | None:
        """Rows of the JSON file; None if the loops are unstable."""
        margins = self.closed.margins
        return None if margins is None else margins_row(margins, self.variants)

    def lines(self) -> list[str]:
        """Return the margins as lines of text."""
        if self.refusal:
            return [f"no stability margins: {self.refusal}"]
        names, count = ", ".join(loop.name for loop in self.loops), self.closed.unstable_samples
        lines = [f"no stability margins: the machine with {names} closed is unstable"]
        if (row := self.row) is not None:
            lines = margin_lines(row)
        if count:
            lines.append(
                f"  unstable in {count} of {self.closed.samples} machines of the posterior"
            )
        return lines

    def write_into(self, folder: Path) -> None:
        """Write loop gains and margins for python-control and MATLAB."""
        if self.closed.margins is not None:
            write_margins(self.closed.margins, self.loops, folder)


def study_loops(
    model: Model,
    path: Path,
    read_variants: Callable[[], VariantModel | None],
    band: tuple[float, float],
) -> LoopStudy | None:
    """Compute the stability of the loops that are closed around a machine; None without any.

    Args:
        model: nominal model of the machine with its closed loops.
        read_variants: returns the machines of tests with models or poses of their own.
        band: of interest [Hz].

    Raises:
        InputError: a file of the tuning or of its campaign cannot be used.
    """
    machine = model.machine
    if not machine.loops:
        return None
    try:
        sampling_period(machine.loops)
    except InputError as error:
        return LoopStudy(machine.loops, ClosedLoops(None, 0, 0), (), str(error))
    fitted = FittedMachine.read(model, path).open_loops()
    definition = loops_alone(machine.loops, (max(band[0], _MIN_LOW_END_SHARE * band[1]), band[1]))
    plant, posterior = LoopPlant.of(fitted.model, definition), fitted.posterior
    closed = closed_loops(plant, fitted.model.drawn, posterior, fitted.thetas, fitted.held_out)
    models = read_variants()
    variants = (
        () if models is None else variant_margins(models, definition, posterior, fitted.thetas)
    )
    return LoopStudy(machine.loops, closed, variants)


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
