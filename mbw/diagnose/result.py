"""Result of ``mbw diagnose``: rows and arrays of its files and its page."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from diagnosis import (
    PROVEN,
    Diagnosis,
    Verdict,
    build_verdict,
    estimate_step_intervals,
    load_catalogue,
)
from diagnosis.estimates.held_out_gap import HeldOutGap
from diagnosis.verdict.schema import CauseRow
from identification.words import Campaign, Complex, Condition, Dof
from mbmodel import Machine, machine_geometry
from mbw.diagnose.augmented import WrittenAugmented
from mbw.diagnose.link_axis import link_axis
from mbw.diagnose.pulled_tolerance import bound_sentence, pull_sentence
from mbw.results.diagnosed_files import StoredDiagnosis, machine_rows, place_row
from mbw.results.diagnosed_schema import (
    CentresRow,
    ChannelRow,
    DiagnosedTestRow,
    EstablishedRow,
    PlaceRow,
    ShownFile,
    StepsRow,
)
from mbw.results.stored_causes import store_causes
from tuning import gap_at_bodies, predict
from tuning.files.input_files import input_rows

STEPS = ("as drawn", "re-tuned", "with the effect")
Cell = tuple[int, Dof]  # index of a test in the campaign, and an output of it


def collect_result(diagnosis: Diagnosis, augmented: WrittenAugmented) -> StoredDiagnosis:
    """Collect the result of a diagnosis, and of the MJCF that it wrote."""
    verdict = build_verdict(diagnosis)
    campaign, machine = diagnosis.retuned.campaign, diagnosis.session.model.machine
    gaps = diagnosis.retuned.channels
    cells = list(zip(gaps.tests, gaps.outputs, strict=True))
    frfs, corrected = _frfs(diagnosis, cells)
    machine_row, machine_arrays = machine_rows(machine.layout, machine_geometry(machine))
    locations = [cause.location for cause in verdict.causes]
    locations += [place for cause in verdict.causes for place in cause.places]
    locations += [share.location for share in verdict.where]
    locations += twin_locations(verdict)
    locations += [remark.location for remark in verdict.remarks]
    locations += [force.location for force in diagnosis.evidence.pushed]
    locations += [force.location for force in diagnosis.evidence.rest_pushed]
    freq = campaign.freq_hz
    pulls = filter(None, (pull_sentence(verdict, diagnosis), bound_sentence(diagnosis)))
    remarks = [*campaign.remarks, *pulls, *unfinished_fit_sentences(diagnosis)]
    shown = ShownFile(
        campaign=campaign.name,
        model=machine.name,
        quantity=campaign.tests[0].estimate.frf.quantity,
        band=(float(freq[0]), float(freq[-1])),
        lines=len(freq),
        block=None
        if (held := diagnosis.retuned.held_out) is None
        else -(-len(freq) // len(held.starts)),
        tests=_tests(campaign),
        channels=[
            ChannelRow(output=str(dof), body=campaign.layout.owner_name(dof), test=test)
            for test, dof in cells
        ],
        corrected=corrected,
        steps=StepsRow(**estimate_step_intervals(diagnosis)),
        centres=_centres(diagnosis),
        means=[_meaning(cause) for cause in verdict.causes],
        established=list_established(diagnosis, verdict),
        solid=[check.sentence for check in diagnosis.checks.bodies],
        taken_out=[
            fault
            for fault in diagnosis.checks.faults
            if "sensor:" in fault.location and fault not in diagnosis.checks.small
        ],
        remarks=remarks,
        machine=machine_row,
        places={name: _place(name, machine, diagnosis) for name in dict.fromkeys(locations)},
        inputs=input_rows(diagnosis.session),
        not_held_by_mjcf=[str(parameter) for parameter in augmented.written.not_held],
        not_held_error=augmented.not_held_error,
        mjcf_difference=augmented.written.difference,
        plant=augmented.plant,
    )
    arrays = {"freq_hz": freq, **frfs, **machine_arrays}
    if diagnosis.after is not None and diagnosis.parameters is not None:
        refit = diagnosis.after.refit
        arrays |= store_causes(refit.session, diagnosis.parameters.theta, refit.causes)
    return StoredDiagnosis(verdict, diagnosis.evidence, shown, arrays)


def list_established(diagnosis: Diagnosis, verdict: Verdict) -> list[EstablishedRow]:
    """Return the causes of the verdict that are established, with the part of the gap of each."""
    present = diagnosis.present
    closed = {key[:2]: present.closes.get(key) for key in present.established}
    sites = [(cause.effect, cause.location) for cause in verdict.causes]
    return [
        EstablishedRow(cause=number, closed=closed[site])
        for number, site in enumerate(sites)
        if site in closed
    ]


def twin_locations(verdict: Verdict) -> list[str]:
    """Return the locations that the pairs of confounded causes name."""
    return [site.partition("@")[2] for pair in verdict.twins for site in pair if "@" in site]


def _place(location: str, machine: Machine, diagnosis: Diagnosis) -> PlaceRow:
    """Return bodies and points of a location, and the axis of a link there."""
    row = place_row(location, machine)
    causes = diagnosis.present.causes
    if not causes or causes[0].location != location:
        return row
    return row.model_copy(update={"axis": link_axis(diagnosis, location)})


def unfinished_fit_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return sentences on the fits behind the figures that did not converge."""
    sentences = []
    if diagnosis.parameters is not None and not diagnosis.parameters.converged:
        sentences.append(
            "The fit that gives the sizes did not converge: the sizes may be less accurate than "
            "stated."
        )
    steps = (("re-tuned", diagnosis.retuned), ("with the cause", diagnosis.after))
    counts = [f"{gap.unfinished} {name}" for name, gap in steps if gap and gap.unfinished]
    if counts:
        sentences.append(
            f"Held-out fits that did not converge: {', '.join(counts)}; the true gaps may be "
            "smaller."
        )
    return sentences


def _centres(diagnosis: Diagnosis) -> list[CentresRow]:
    """Return the gap at the centres of mass: as drawn on all lines, then on held-out lines."""
    session = diagnosis.session
    nominal = predict(session.model, session.parametrisation.fixed, session.campaign)
    steps = [(STEPS[0], nominal, session.campaign)]
    held_out = (diagnosis.retuned, *((diagnosis.after,) if diagnosis.after else ()))
    steps += [
        (name, gap.predicted, gap.campaign) for name, gap in zip(STEPS[1:], held_out, strict=False)
    ]
    gaps = [(name, gap_at_bodies(predicted, measured)) for name, predicted, measured in steps]
    return [
        CentresRow(name=name, error=gap.error, excess=gap.excess, channels=gap.channels)
        for name, gap in gaps
    ]


def _meaning(row: CauseRow) -> str:
    effect = load_catalogue().get(row.effect) or PROVEN.get(row.effect)
    return effect.describe(effect.means, row.location, row.dof) if effect else ""


def _frfs(diagnosis: Diagnosis, cells: Sequence[Cell]) -> tuple[dict[str, Any], list[int]]:
    """Return arrays with a column for each channel, and the channels that the effect corrects."""
    retuned, after = diagnosis.retuned, diagnosis.after
    measured = _columns(_measured_values(retuned), retuned, cells)
    variance = [test.estimate.variance for test in retuned.campaign.tests]
    arrays: dict[str, Any] = {
        "measured": measured.astype(np.complex64),
        "retuned": _columns(retuned.predicted, retuned, cells).astype(np.complex64),
        "after": np.zeros((len(measured), 0), np.complex64),
        "corrected": np.zeros((len(measured), 0), np.complex64),
        "noise": np.sqrt(_columns(variance, retuned, cells)).astype(np.float32),
        "channel_noise": retuned.channels.noise,
        **_gaps("retuned", retuned, cells),
        **_gaps("after", after, cells),
    }
    if after is None:
        return arrays, []
    without_effect = _columns(_measured_values(after), after, cells)
    corrected = np.flatnonzero((without_effect != measured).any(axis=0))
    arrays["after"] = _columns(after.predicted, after, cells).astype(np.complex64)
    arrays["corrected"] = without_effect[:, corrected].astype(np.complex64)
    return arrays, corrected.tolist()


def _measured_values(level: HeldOutGap) -> list[Complex]:
    return [test.estimate.frf.values for test in level.campaign.tests]


def _columns(values: Sequence[Any], level: HeldOutGap, cells: Sequence[Cell]) -> Any:
    """Return the values of all tests with a column for each channel; (n_freq, n_channel)."""
    outputs = [test.estimate.frf.outputs for test in level.campaign.tests]
    columns: list[Complex] = [values[test][:, outputs[test].index(dof), 0] for test, dof in cells]
    return np.stack(columns, axis=1) if columns else np.zeros((len(level.campaign.freq_hz), 0))


def _gaps(name: str, level: HeldOutGap | None, cells: Sequence[Cell]) -> dict[str, Any]:
    """Return error and excess of each channel."""
    error, excess = np.full((2, len(cells)), np.nan)
    if level is not None:
        gaps = level.channels
        rows = {cell: k for k, cell in enumerate(zip(gaps.tests, gaps.outputs, strict=True))}
        for column, cell in enumerate(cells):
            if cell in rows:
                k = rows[cell]
                error[column] = gaps.error[k]
                excess[column] = gaps.error[k] / gaps.noise[k] if gaps.noise[k] > 0 else np.nan
    return {f"{name}_error": error, f"{name}_excess": excess}


def _tests(campaign: Campaign) -> list[DiagnosedTestRow]:
    conditions = [test.condition for test in campaign.tests]
    return [
        DiagnosedTestRow(
            label=label,
            file=test.condition.test,
            reference=str(test.condition.reference),
            level=test.condition.level_n,
            setup=test.condition.setup,
            averages=test.estimate.averages,
            variance_from=test.estimate.variance_source,
        )
        for test, label in zip(campaign.tests, _labels(conditions), strict=True)
    ]


def _labels(conditions: Sequence[Condition]) -> list[str]:
    """Return labels of tests: the reference, with level, set-up and file where these differ."""
    levels = {condition.level_n for condition in conditions}
    setups = {condition.setup for condition in conditions}
    labels = [
        str(condition.reference)
        + (f", {condition.level_text}" if len(levels) > 1 and condition.level_n is not None else "")
        + (f", set-up {condition.setup}" if len(setups) > 1 and condition.setup is not None else "")
        for condition in conditions
    ]
    if len(set(labels)) == len(labels):
        return labels
    return [
        f"{label} in {condition.test}" for label, condition in zip(labels, conditions, strict=True)
    ]
