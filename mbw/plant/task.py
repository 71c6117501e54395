"""The error budget of ``mbw predict --budget``, and the machine that stands beside it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from diagnosis import Verdict
from identification.readers.result_files import read_result_json
from identification.readers.toml_files import load_toml
from identification.words import InputError, UsageError, capitalise
from mbmodel import Model, as_drawn, load_machine
from mbw.output_folder import folder_beside, source_of
from mbw.plant.closed_margins import LoopStudy, study_loops, write_margins
from mbw.plant.margin_schema import MarginsRow
from mbw.plant.page import PLANT_PAGE, render_plant
from mbw.plant.rows import budget_row
from mbw.plant.schema import BudgetRow, StrutsRow
from mbw.plant.sentences import budget_lines_of_text, cause_sentences
from mbw.plant.struts import StrutsResult, compute_struts
from mbw.results.rivals import rival_sentence
from tuning.files.plant_findings import PlantFindings
from tuning.files.plant_folder import (
    AUGMENTED,
    VERDICT,
    plant_doubts,
    plant_file,
)
from tuning.files.result import TUNED_MJCF
from tuning.plant.error_budget.machine_files import FittedMachine, open_loops
from tuning.plant.error_budget.margin_design import design_loops
from tuning.plant.error_budget.plant_budget import PlantBudget, plant_budget
from tuning.plant.error_budget.read_definition import read_definition
from tuning.plant.variant_model import VariantModel

_MIN_CAUSE_PROBABILITY = 0.5  # of a cause that the augmented machine holds


@dataclass(frozen=True)
class BudgetRequest:
    """Error budget and struts that ``mbw predict`` computes.

    Args:
        budget: budget.toml; None for no budget.
        before: MJCF of the machine that stands beside; None for the nominal one of a tuning, or
            the tuned one of a diagnosis.
        struts: names of struts with force feedback; empty for none.
    """

    budget: Path | None
    before: Path | None = None
    struts: Sequence[str] = ()

    @property
    def is_wanted(self) -> bool:
        """Whether anything is asked for."""
        return self.budget is not None or bool(self.struts)

    def check(self) -> None:
        """Refuse a machine beside without a budget.

        Raises:
            UsageError: there is no budget.
        """
        if self.before is not None and self.budget is None:
            raise UsageError("--before names a machine for the budget: add --budget FILE")


@dataclass(frozen=True, eq=False)
class BudgetResult:
    """A budget with its rows.

    Args:
        plant: the budget, and what stands beside it.
        row: for the JSON file.
        names: of the machine, and of the counterpart.
        causes: sentences on what a diagnosis found.
        first: doubts about the fit of the machine, and sentences on drives that are late, for the
            page; the terminal has them already.
        notes: remarks that only say which frequencies test and spectra cover.
        limits: sentences on what limits the gain of each loop.
    """

    plant: PlantBudget
    row: BudgetRow
    names: tuple[str, str]
    causes: tuple[str, ...]
    first: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Return the budget as lines of text."""
        return [*budget_lines_of_text(self.row, self._units), *self.limits, *self.causes]

    def page(self, struts: StrutsResult | None) -> str:
        """Return the HTML page, with a section on struts if there is one."""
        row = self.row.model_copy(update={"remarks": [*self.first, *self.row.remarks]})
        return render_plant(self.plant, row, self.names, self.causes, struts, notes=self.notes)

    @property
    def _units(self) -> list[float]:
        units = self.plant.budget.definition.units
        return [units[error.name][1] for error in self.row.errors]


@dataclass(frozen=True, eq=False)
class PlantStudy:
    """Budget and struts of one machine.

    Args:
        budget: None if not asked for.
        struts: None if not asked for.
        loops: stability of closed loops; None with a budget, which has it, and without loops.
    """

    budget: BudgetResult | None
    struts: StrutsResult | None
    loops: LoopStudy | None = None

    def lines(self) -> list[str]:
        """Return all as lines of text."""
        results = (self.budget, self.struts, self.loops)
        return [line for result in results if result is not None for line in result.lines()]

    def rows(self) -> dict[str, BudgetRow | StrutsRow | MarginsRow]:
        """Return the rows of the JSON file by key."""
        rows: dict[str, BudgetRow | StrutsRow | MarginsRow] = {}
        if self.loops is not None and (margins := self.loops.row) is not None:
            rows["margins"] = margins
        if self.budget is not None:
            rows["budget"] = self.budget.row
        if self.struts is not None:
            rows["struts"] = self.struts.row
        return rows

    def write_into(self, folder: Path) -> None:
        """Write plant.html, which a budget has, and the loop gains."""
        if self.loops is not None:
            self.loops.write_into(folder)
        if self.budget is not None:
            text = self.budget.page(self.struts)
            (folder / PLANT_PAGE).write_text(text, encoding="utf-8")
            plant = self.budget.plant
            if plant.margins is not None:
                write_margins(plant.margins, plant.budget.definition.loops, folder)


def study_plant(
    model: Model,
    path: Path,
    request: BudgetRequest,
    band: tuple[float, float],
    read_variants: Callable[[], VariantModel | None],
) -> PlantStudy:
    """Compute budget and struts, as far as they are asked for, and margins of closed loops.

    Args:
        model: nominal model of the machine with what is put on it, and laws of its springs.
        path: MJCF of the machine.
        band: of the coupling of struts without a budget [Hz].
        read_variants: returns the machines of tests with models or poses of their own.

    Raises:
        InputError: a file cannot be used, or the machine is unstable with the loops.
        UsageError: a name of no strut.
    """
    budget = struts = None
    if request.budget is not None:
        budget = _compute_budget(
            model, path, request.budget, before=request.before, read_variants=read_variants
        )
        band = budget.row.band
    if request.struts:
        struts = compute_struts(model, path, request.struts, band)
    loops = None
    if budget is None:
        loops = study_loops(model, path, read_variants, band)
    return PlantStudy(budget, struts, loops)


def _compute_budget(
    model: Model,
    path: Path,
    file: Path,
    *,
    before: Path | None,
    read_variants: Callable[[], VariantModel | None],
) -> BudgetResult:
    """Return the error budget of a machine, and of the machine beside it."""
    machine = model.machine
    definition = read_definition(file, machine)
    fitted = FittedMachine.read(model, path)
    before = before or _machine_before(path)
    counterpart = None
    if before is not None:
        before = plant_file(before)
        counterpart = FittedMachine.read(as_drawn(load_machine(before)), before).model
        read_definition(file, counterpart.machine)  # refuses labels that it lacks
    variants = read_variants() if definition.loops else None
    designs = design_loops(open_loops(fitted.model), definition) if definition.loops else ()
    limits = [line for loop in designs for line in loop.limit_sentences()]
    try:
        plant = plant_budget(fitted, definition, counterpart, variants)
    except InputError as error:
        is_unstable = any(loop.pole is not None for loop in designs)
        hints = [loop.limit_sentences()[0] for loop in designs if loop.is_limited]
        raise InputError("; ".join([str(error), *(hints if is_unstable else [])])) from error
    remarks, notes = plant.sentences(), definition.remarks
    findings = PlantFindings.beside(path)
    if untested := findings.untested_band_remark(definition.band):
        notes = (*notes, f"{capitalise(untested)}.")
        remarks.append(notes[-1])
    if plant.before_failure and before is not None:
        remarks.append(f"{before.name} has no budget: {plant.before_failure}")
    row = budget_row(plant, file.name, None if before is None else str(before), remarks, designs)
    names = (machine.name, "" if before is None else _name_of(before))
    verdict = None if before is None or before.name != TUNED_MJCF else _verdict_of(path)
    units = [definition.units[error.name][1] for error in row.errors]
    sentences = [] if verdict is None else _sentences_on_causes(verdict, row, units)
    lags = findings.lag_remarks(machine.motors)
    first = [*plant_doubts(path), *(f"{capitalise(text)}." for text in lags)]
    return BudgetResult(plant, row, names, tuple(sentences), tuple(first), notes, tuple(limits))


def _name_of(before: Path) -> str:
    """Return the name of the counterpart: the fit that wrote it, or as drawn."""
    fits = {TUNED_MJCF: "tuned", AUGMENTED: "diagnosed"}
    return fits.get(before.name, f"as drawn ({before.name})")


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


def _verdict_of(path: Path) -> Verdict | None:
    """Return the verdict of an augmented machine; None of any other machine."""
    verdict = path.parent / VERDICT
    if path.name != AUGMENTED or not verdict.is_file():
        return None
    return read_result_json(verdict, Verdict, "mbw diagnose")


def _sentences_on_causes(verdict: Verdict, row: BudgetRow, units: list[float]) -> list[str]:
    """Return what the causes of an augmented machine cost, and which rivals they have."""
    held = [cause for cause in verdict.causes if cause.probability >= _MIN_CAUSE_PROBABILITY]
    if not held:
        return []
    names = [f"{cause.effect} at {cause.location}" for cause in held]
    rivals = rival_sentence(verdict, [f"{cause.effect}@{cause.location}" for cause in held])
    return [*cause_sentences(row, units, names), *([rivals] if rivals else [])]
