"""The error budget of ``mbw predict --budget``, and the machine that stands beside it."""

from dataclasses import dataclass
from pathlib import Path

from diagnosis import Verdict
from identification.readers.result_files import read_result_json
from identification.readers.toml_files import load_toml
from mbmodel import Machine, Model, load_machine
from mbw.diagnose.files import AUGMENTED, VERDICT
from mbw.output_folder import folder_beside, source_of
from mbw.plant.page import render_plant
from mbw.plant.rows import budget_row
from mbw.plant.schema import BudgetRow
from mbw.plant.sentences import budget_lines_of_text, cause_sentences
from mbw.plant.struts import StrutsResult
from tuning.error_budget.machine_files import model_with_posterior, tuned_file
from tuning.error_budget.plant_budget import PlantBudget, plant_budget
from tuning.error_budget.read_definition import read_definition
from tuning.files.result import TUNED_MJCF

_MIN_CAUSE_PROBABILITY = 0.5  # of a cause that the augmented machine holds


@dataclass(frozen=True)
class BudgetRequest:
    """What ``mbw predict`` is asked for of errors.

    Args:
        file: budget.toml.
        before: MJCF of the machine that stands beside; None for the nominal one of a tuning, or
            the tuned one of a diagnosis.
    """

    file: Path
    before: Path | None = None


@dataclass(frozen=True, eq=False)
class BudgetResult:
    """A budget with its rows.

    Args:
        plant: the budget, and what stands beside it.
        row: for the JSON file.
        names: of the machine, and of the counterpart.
        causes: sentences on what a diagnosis found.
    """

    plant: PlantBudget
    row: BudgetRow
    names: tuple[str, str]
    causes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the budget as lines of text."""
        return [*budget_lines_of_text(self.row, self._units), *self.causes]

    def page(self, struts: StrutsResult | None) -> str:
        """Return the HTML page, with a section on struts if there is one."""
        return render_plant(self.plant, self.row, self.names, self.causes, struts)

    @property
    def _units(self) -> list[float]:
        units = self.plant.budget.definition.units
        return [units[error.name][1] for error in self.row.errors]


def compute_budget(
    machine: Machine, model: Model, path: Path, request: BudgetRequest
) -> BudgetResult:
    """Compute the error budget of a machine, and of the machine beside it.

    Args:
        machine: with what is put on it.
        model: its nominal model with laws of its springs, for a machine without a posterior.
        path: MJCF of the machine.
        request: budget.toml, and the counterpart.

    Raises:
        InputError: a file cannot be used, or the machine is unstable with the loops.
    """
    definition = read_definition(request.file, machine)
    fitted, posterior = model_with_posterior(machine, path)
    before = request.before or _machine_before(path)
    counterpart = None
    if before is not None:
        before = tuned_file(before)
        counterpart, _ = model_with_posterior(load_machine(before), before)
        read_definition(request.file, counterpart.machine)  # refuses labels that it lacks
    plant = plant_budget(model if posterior is None else fitted, definition, counterpart, posterior)
    remarks = list(definition.remarks)
    if plant.before_failure and before is not None:
        remarks.append(f"{before.name} has no budget: {plant.before_failure}")
    row = budget_row(plant, request.file.name, None if before is None else str(before), remarks)
    names = (machine.name, "" if before is None else _name_of(before))
    causes = _causes(path) if before is not None and before.name == TUNED_MJCF else []
    units = [definition.units[error.name][1] for error in row.errors]
    sentences = cause_sentences(row, units, causes) if causes else []
    return BudgetResult(plant, row, names, tuple(sentences))


def _name_of(before: Path) -> str:
    """Return the name of the counterpart: as drawn, or by its file."""
    return "tuned" if before.name == TUNED_MJCF else f"as drawn ({before.name})"


def _machine_before(path: Path) -> Path | None:
    """Return the MJCF that a result's machine is to be compared with; None if unknown.

    A tuned machine is compared with the nominal one of its campaign, an augmented one with the
    tuned one of the same campaign.
    """
    campaign = source_of(path.parent, path.name)
    if campaign is None or not campaign.is_file() or campaign.suffix != ".toml":
        return None
    if path.name == AUGMENTED:
        tuned = folder_beside(campaign, "tuned") / TUNED_MJCF
        return tuned if tuned.is_file() else None
    name = load_toml(campaign).get("model")
    nominal = campaign.parent / str(name) if name else None
    is_usable = path.name == TUNED_MJCF and nominal is not None and nominal.is_file()
    return nominal if is_usable else None


def _causes(path: Path) -> list[str]:
    """Return the causes that an augmented machine holds, as its verdict names them."""
    verdict = path.parent / VERDICT
    if path.name != AUGMENTED or not verdict.is_file():
        return []
    causes = read_result_json(verdict, Verdict, "mbw diagnose").causes
    return [
        f"{cause.effect} at {cause.location}"
        for cause in causes
        if cause.probability >= _MIN_CAUSE_PROBABILITY
    ]
