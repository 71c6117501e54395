"""The error budget of a machine, with its intervals."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.words import InputError, Real, UsageError
from mbmodel import TimeResponse, as_drawn, load_machine, with_loops
from mbmodel.simulation.drives import REFERENCE, parse_drive
from mbworkbench.labels import AnyPath, as_path
from mbworkbench.model import MachineModel, read_model
from mbworkbench.tables import Shown, Table
from tuning.control_loops.loops_file import choose_loops, known_loops
from tuning.files.plant_folder import plant_doubts, plant_file
from tuning.files.result import TUNED_JSON
from tuning.plant.error_budget.loop_margins import PlantMargins, VariantMargins
from tuning.plant.error_budget.machine_files import FittedMachine
from tuning.plant.error_budget.margin_design import LoopDesign, design_loops
from tuning.plant.error_budget.plant_budget import PlantBudget, plant_budget
from tuning.plant.error_budget.read_definition import read_definition
from tuning.plant.error_budget.simulated_budget import SimulatedErrors
from tuning.plant.error_budget.simulated_budget import simulate_budget as simulate_budget_in_time
from tuning.plant.variant_model import read_variant_model


@dataclass(frozen=True, eq=False)
class ErrorBudgetResult(Shown):
    """Errors of a machine under its disturbances, in SI, with shares and intervals.

    Attributes:
        plant: spectra, shares, poles and gradients.
        doubts: about the fit of the machine, one sentence each.
    """

    plant: PlantBudget
    doubts: tuple[str, ...] = ()

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square of each error by name [m or rad]."""
        budget = self.plant.budget
        names = [error.name for error in budget.definition.errors]
        return dict(zip(names, budget.rms.tolist(), strict=True))

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """Ends of the 95 % interval of each error [m or rad]; empty without a posterior."""
        if self.plant.interval is None:
            return {}
        low, high = self.plant.interval.ends()
        return dict(zip(self.rms, zip(low.tolist(), high.tolist(), strict=True), strict=True))

    @property
    def sources(self) -> dict[str, dict[str, float]]:
        """Share of each source in the mean square of each error, without cross terms."""
        budget = self.plant.budget
        names = [source.name for source in budget.definition.sources]
        rows = budget.source_shares.tolist()
        return {
            error: dict(zip(names, row, strict=True))
            for error, row in zip(self.rms, rows, strict=True)
        }

    @property
    def margins(self) -> PlantMargins | None:
        """Stability margins of the loops; None without any."""
        return self.plant.margins

    @property
    def variants(self) -> dict[str, VariantMargins]:
        """Stability of the loops in each model and pose of the campaign, by name."""
        return {each.variant: each for each in self.plant.variant_margins}

    def _rows(self) -> list[tuple[str, str, str, str]]:
        """Return name, rms, interval and largest source of each error."""
        units, intervals = self.plant.budget.definition.units, self.interval
        rows = []
        for name, value in self.rms.items():
            unit, size = units[name]
            ends = intervals.get(name)
            largest = max(self.sources[name].items(), key=lambda pair: pair[1])
            rows.append(
                (
                    name,
                    f"{value / size:.4g} {unit}",
                    "" if ends is None else f"{ends[0] / size:.4g} to {ends[1] / size:.4g}",
                    f"{largest[0]} {100 * largest[1]:.0f} %",
                )
            )
        return rows

    def __repr__(self) -> str:
        """Return doubts, each error with its interval and its largest source, and remarks."""
        lines = [
            f"{name}: {value} rms{f' (95 %: {ends})' if ends else ''}, largest source {source}"
            for name, value, ends, source in self._rows()
        ]
        return "\n".join([*self.doubts, *lines, *self.remarks])

    @property
    def remarks(self) -> list[str]:
        """Sentences on what the budget leaves out, such as images of sampled loops."""
        return self.plant.sentences()

    def table(self) -> Table:
        """Return a table of the errors."""
        header = ("error", "rms", "95 % interval", "largest source")
        title = "; ".join(("Error budget", *self.doubts))
        return Table(title, header, self._rows())


@dataclass(frozen=True, eq=False)
class MarginsResult(Shown):
    """Margins of control loops, stable or not, and what limits them.

    Attributes:
        loops: loop gain, sensitivity, margins, largest crossover and limiting modes of each.
    """

    loops: tuple[LoopDesign, ...]

    def __repr__(self) -> str:
        """Return margins, the largest crossover and the limiting modes of each loop."""
        return "\n".join(line for loop in self.loops for line in loop.sentences())

    def table(self) -> Table:
        """Return a table of the modes that limit each loop."""
        rows = [
            (
                loop.loop,
                mode.freq_hz,
                mode.gain,
                mode.notch or float("nan"),
                next(iter(mode.changes), ""),
            )
            for loop in self.loops
            for mode in loop.modes
        ]
        header = ("loop", "mode [Hz]", "gain at most", "notch", "strongest parameter")
        return Table("Modes that limit the gain", header, rows)


def margins(
    model: MachineModel | AnyPath,
    budget: AnyPath,
    *,
    controllers: Mapping[str, Any] | None = None,
    modulus: float = 0.5,
) -> MarginsResult:
    """Return the margins of the loops of a budget, stable or not, and what limits each.

    Each mode that limits the gain comes with its part on the machine, a notch with its cost in
    phase, and the change of the gain for 10 % more of each stiffness, damping and mass, for a moved
    sensor or force, and for struts.

    Args:
        model: as for ``error_budget``; a tuning or diagnosis gives bands over its posterior.
        budget: path of budget.toml with loops.
        controllers: systems of python-control that replace controllers of the file.
        modulus: modulus margin that the largest crossover keeps; 0.5 bounds the sensitivity by 2.

    Raises:
        InputError: a file cannot be used, or it has no loop.
        UsageError: a modulus margin that is not between 0 and 1.
    """
    if not 0 < modulus < 1:
        raise UsageError(f"modulus {modulus:g}: give a margin between 0 and 1, such as 0.5")
    if not isinstance(model, MachineModel):
        model = read_model(plant_file(as_path(model)))
    definition = read_definition(as_path(budget), model.machine, controllers, loops_suffice=True)
    if not definition.loops:
        raise InputError(f"{budget} has no loop, and so no margins: add [loop.NAME]")
    fitted = FittedMachine.read(as_drawn(model.machine), model.machine.source).open_loops()
    thetas = () if fitted.thetas is None else tuple(fitted.thetas)
    return MarginsResult(design_loops(fitted.model, definition, modulus, thetas))


@dataclass(frozen=True, eq=False)
class SimulatedBudget(Shown):
    """A machine in time under the sources of a budget, with its loops closed.

    Attributes:
        simulated: errors (``response.watched``), loops and outputs in time, beside the budget.
    """

    simulated: SimulatedErrors

    @property
    def response(self) -> TimeResponse:
        """Time, outputs, and ``loops`` with reference, error and control of each."""
        return self.simulated.response

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square of each error over the time [m or rad]."""
        names = [error.name for error in self.simulated.definition.errors]
        return dict(zip(names, self.simulated.rms.tolist(), strict=True))

    def __repr__(self) -> str:
        """Return each error with that of the budget, and the tracking error of each loop."""
        expected = self.simulated.predicted
        lines = [
            f"{name}: {rms:.4g} rms"
            + ("" if expected is None else f", {expected[k]:.4g} predicted")
            for k, (name, rms) in enumerate(self.rms.items())
        ]
        lines += [
            f"loop {row[0]}: error {row[1]:.4g} {row[3]} rms, {row[2]:.4g} {row[3]} at most"
            for row in self._loop_rows()
        ]
        return "\n".join([*lines, *self.simulated.remarks, *self.response.remarks])

    def _loop_rows(self) -> list[tuple[str, float, float, str]]:
        """Return name, rms, largest value and unit of the error of each loop."""
        return [
            (
                record.loop.name,
                float(np.sqrt(np.mean(record.error**2))),
                float(np.abs(record.error).max()),
                record.loop.measured.unit,
            )
            for record in self.response.loops
        ]

    def table(self) -> Table:
        """Return a table of the loops."""
        header = ("loop", "error rms", "error at most", "unit")
        return Table(repr(self).splitlines()[0], header, self._loop_rows())


def simulate_budget(
    model: MachineModel | AnyPath,
    budget: AnyPath,
    time_s: Real,
    *,
    references: Mapping[str, Real] | None = None,
    controllers: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> SimulatedBudget:
    """Simulate a machine in time with the loops and sources of a budget.

    Args:
        model: as for ``error_budget``; its joints may be nonlinear.
        budget: path of budget.toml.
        time_s: evenly spaced from 0 on [s]; a whole number of samples to each sampling period, and
            8 to each period of the highest frequency of the sources; (n_time,).
        references: of loops, by their names, in the unit of what they measure; (n_time,) each.
        controllers: systems of python-control that replace controllers of the file.
        seed: of the sources.

    Raises:
        InputError: a file cannot be used.
        UsageError: a reference of no loop, or times that do not suit loops and sources.
        ConvergenceError: the motion grows without bound.
    """
    if not isinstance(model, MachineModel):
        source = plant_file(as_path(model))
        model = MachineModel(load_machine(source, without_friction=True))
    definition = read_definition(as_path(budget), model.machine, controllers, loops_suffice=True)
    played = {
        parse_drive(model.machine, f"{REFERENCE}:{name}", definition.loops): np.asarray(values)
        for name, values in (references or {}).items()
    }
    times = np.asarray(time_s, float)
    return SimulatedBudget(
        simulate_budget_in_time(model.machine, definition, times, played, seed=seed)
    )


def error_budget(
    model: MachineModel | AnyPath,
    budget: AnyPath,
    *,
    controllers: Mapping[str, Any] | None = None,
    before: MachineModel | None = None,
    closed: Iterable[str] = (),
    campaign: AnyPath | None = None,
) -> ErrorBudgetResult:
    """Compute the error budget of a machine.

    Args:
        model: from ``read_model``, or the path of an MJCF, or of the folder of a tuning or
            diagnosis. Their MJCF with ``posterior.npz`` beside it has intervals.
        budget: path of budget.toml.
        controllers: systems of python-control that replace controllers of the file, by the name of
            their loop.
        before: another machine to compare with.
        closed: names of loops that were closed during the test of a tuning and stay closed, beside
            those of budget.toml; ``"*"`` for all.
        campaign: whose tests had models or poses of their own: the loops are checked in each.

    Raises:
        InputError: a file cannot be used, or the machine is unstable with its loops.
        UsageError: a controller of no loop, or one that is no linear controller.
    """
    if not isinstance(model, MachineModel):
        model = read_model(plant_file(as_path(model)))
    source, patterns = model.machine.source, (closed,) if isinstance(closed, str) else closed
    loops = choose_loops(known_loops(source, model.machine), patterns)
    definition = read_definition(as_path(budget), with_loops(model.machine, loops), controllers)
    reference, variants = None if before is None else as_drawn(before.machine), None
    if campaign is not None:
        folder = source.parent if (source.parent / TUNED_JSON).is_file() else None
        variants = read_variant_model(as_path(campaign), folder)
    fitted = FittedMachine.read(as_drawn(model.machine), source)
    plant = plant_budget(fitted, definition, reference, variants)
    return ErrorBudgetResult(plant, tuple(plant_doubts(source)))
