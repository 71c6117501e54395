"""All that ``mbw predict`` computes: modes, curves, and both before additions.

JSON of a machine before and after something is put on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identification.words import Complex, Real, capitalise
from mbmodel import COMBINED_NAME, FrfRequest, Machine, StateSpaceComparison, compare_state_space
from mbw.predict.before_after import BeforeAfter, compare, comparison_table, frequency_change
from mbw.predict.curves import Curves, drive_points, requested_curves, with_curves_before
from mbw.predict.machines import Additions, Machines
from mbw.predict.mode_rows import modes_file, pole_fields, table
from mbw.predict.requests import PredictRequest, frequency_lines, read_quantity
from mbw.predict.schema import (
    AddedMassRow,
    BeforeAfterRow,
    FrfPeakRow,
    ModeRow,
    PlantRow,
    PredictedModesFile,
    PutOnTopRow,
    StateSpaceCheckRow,
)
from mbw.predict.state_space_check import check_lines, check_request, check_row
from mbw.prediction import Prediction, predict


@dataclass(frozen=True, eq=False)
class Outcome:
    """Modes and FRFs of a machine, and of the machine alone if something is put on it.

    Args:
        prediction: modes of the machine, with what is put on it.
        curves: FRFs of the page; None if no output needs them.
        comparison: modes before and after; None if nothing is put on the machine.
        combination_remarks: sentences on the combination.
        state_space: FRFs of the state space beside those of the model; None if not asked for.
        plant_rows: rows of the JSON file about the plant, by key.
        doubts: about the fit of the machine, one sentence each, which stand first.
    """

    prediction: Prediction
    curves: Curves | None
    comparison: BeforeAfter | None
    combination_remarks: tuple[str, ...]
    state_space: StateSpaceComparison | None
    plant_rows: Mapping[str, PlantRow] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    @property
    def machine(self) -> Machine:
        """Machine whose modes are predicted."""
        return self.prediction.machine

    @property
    def remarks(self) -> list[str]:
        """Doubts, then findings on the model and the combination, one sentence each."""
        sentences = [f"{capitalise(text)}." for text in self.combination_remarks]
        return [*self.doubts, *sentences, *self.prediction.remarks]

    @property
    def state_space_row(self) -> StateSpaceCheckRow | None:
        """Comparison of the state space for JSON and page."""
        if self.state_space is None:
            return None
        return check_row(self.state_space, self.prediction.model)

    def json(self) -> str:
        """Return the content of the JSON file; what was not asked for has no key."""
        return self.summary().model_dump_json(indent=1, exclude_unset=True)

    def summary(self) -> PredictedModesFile:
        """Return the rows of the JSON file."""
        summary = modes_file(self.prediction)
        if self.comparison is not None and self.curves is not None:
            summary.remarks = self.remarks[len(self.doubts) :]
            summary.put_on_top = put_on_top_row(self.comparison, self.curves)
        if (row := self.state_space_row) is not None:
            summary.state_space_check = row
        if self.doubts:
            summary.doubts = list(self.doubts)
        for key, plant_row in self.plant_rows.items():
            setattr(summary, key, plant_row)
        return summary

    def table(self) -> list[str]:
        """Return the tables of modes as lines of text."""
        lines = table(self.prediction)
        if self.comparison is not None:
            lines += ["", *comparison_table(self.comparison)]
        return lines

    def check_lines(self) -> list[str]:
        """Return the comparison of the state space as lines of text; none without it."""
        row = self.state_space_row
        return [] if row is None else check_lines(row)


def predict_outcome(
    machines: Machines,
    additions: Additions,
    request: PredictRequest,
    frfs: FrfRequest | None,
    *,
    has_page: bool,
    has_check: bool,
) -> Outcome:
    """Compute modes and curves.

    Args:
        machines: the machine alone and combined.
        additions: what is put on it.
        request: frequency lines and quantity.
        frfs: FRFs that the user names; None for drive points.
        has_page: whether the page is written, which shows curves.
        has_check: whether the state space is compared.
    """
    prediction = predict(machines.model)
    check = None
    if has_check:
        inputs = frfs.inputs if frfs is not None and request.inputs else ()
        wanted = check_request(machines.model.machine, request, inputs)
        check = compare_state_space(machines.model, wanted)
    if machines.combined is None:
        curves = _curves([prediction], request, frfs) if has_page else None
        return Outcome(prediction, curves, None, (), check)
    before = predict(machines.base)
    curves = _curves([prediction, before], request, frfs)
    return Outcome(
        prediction,
        with_curves_before(curves, machines.base),
        compare(before, prediction, additions, machines.combined.file.prefix),
        machines.combined.remarks,
        check,
    )


def _curves(
    predictions: list[Prediction], request: PredictRequest, frfs: FrfRequest | None
) -> Curves:
    """Return FRFs of the first prediction, with lines at the resonances of all."""
    model, modes = predictions[0].model, [prediction.modes for prediction in predictions]
    if frfs is not None:
        return requested_curves(model, modes, frfs)
    lines = frequency_lines(modes[0], request)
    return drive_points(model, modes, lines, read_quantity(request))


def put_on_top_row(comparison: BeforeAfter, curves: Curves) -> PutOnTopRow:
    """Return what was put on the machine, with modes and FRFs before and after.

    Args:
        comparison: modes before and after.
        curves: FRFs before and after.
    """
    additions, stage = comparison.additions, comparison.additions.stage
    place = "" if stage is None else stage.place
    spot = place if isinstance(place, str) else ",".join(f"{value:g}" for value in place)
    return PutOnTopRow(
        combined=COMBINED_NAME,
        stage=None if stage is None else str(stage.path),
        at=None if stage is None else f"{stage.body}:{spot}",
        prefix=comparison.prefix,
        added_masses=[
            AddedMassRow(body=mass.body, mass=mass.mass_kg, offset=list(mass.offset_m))
            for mass in additions.masses
        ],
        before=[
            ModeRow(**pole_fields(comparison.before, number))
            for number in range(len(comparison.before.modes.poles))
        ],
        pairs=[_pair(comparison, *pair) for pair in comparison.pairs],
        new=comparison.new,
        gone=comparison.gone,
        frfs=_peaks(curves),
    )


def _damping(prediction: Prediction, number: int) -> float | None:
    """Return the damping ratio of a mode; None for a mode at rest."""
    is_at_rest = prediction.is_at_rest(number)
    return None if is_at_rest else float(prediction.modes.damping[number])


def _pair(comparison: BeforeAfter, before: int, after: int) -> BeforeAfterRow:
    return BeforeAfterRow(
        before=before,
        after=after,
        mac=float(comparison.criterion[before, after]),
        frequency_change=frequency_change(comparison, before, after),
        damping_before=_damping(comparison.before, before),
        damping_after=_damping(comparison.after, after),
    )


def _peaks(curves: Curves) -> list[FrfPeakRow]:
    """Return the largest magnitude of each FRF, before and after."""
    rows = []
    for number, label in enumerate(curves.labels):
        (before, before_hz), (after, after_hz) = (
            _largest_magnitude(curves.freq_hz, values[number])
            for values in (curves.before, curves.values)
        )
        rows.append(
            FrfPeakRow(
                label=label,
                unit=curves.units[number],
                peak_before=before,
                peak_before_hz=before_hz,
                peak_after=after,
                peak_after_hz=after_hz,
            )
        )
    return rows


def _largest_magnitude(freq_hz: Real, values: Complex) -> tuple[float | None, float | None]:
    """Return the largest magnitude of an FRF and its frequency; None for an FRF of nan."""
    size = np.abs(values)
    if not np.isfinite(size).all():
        return None, None
    largest = int(size.argmax())
    return float(size[largest]), float(freq_hz[largest])
