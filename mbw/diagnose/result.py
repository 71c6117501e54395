"""What the page of a diagnosis shows, gathered from it as plain rows and arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis import PROVEN, Diagnosis, Verdict, catalogue, step_intervals, verdict_of
from diagnosis.estimates.held_out_gap import Level
from diagnosis.inference.evidence import Evidence
from diagnosis.verdict.schema import CauseRow
from identification.words import Campaign, Complex, Condition, Dof
from mbmodel import NotHeld, looks
from mbw.diagnose.machine_rows import machine_rows, place_row
from mbw.diagnose.pulled_tolerance import pulled_sentence
from mbw.diagnose.schema import CentresRow, ChannelRow, ShownFile, StepsRow, TestRow
from mbw.identify.solid import fault_row
from tuning import gap_at_bodies, predict
from tuning.files.input_files import inputs

STEPS = ("as drawn", "re-tuned", "with the effect")
Cell = tuple[int, Dof]  # of a campaign: number of a test, an output of it


@dataclass(frozen=True, eq=False)
class Result:
    """A diagnosis as its folder holds it.

    Args:
        verdict: verdict.json.
        evidence: what it was judged by, evidence.json.
        shown: names and labels, diagnosis.json.
        arrays: by name, diagnosis.npz. FRFs are (n_freq, n_channel): ``measured``, ``retuned`` and
            ``after``, the last of no columns without a cause; ``corrected``, what the measurement
            would be without the effect, (n_freq, n_corrected); ``noise``, one standard deviation.
            Of each channel ``retuned_excess``, ``retuned_error`` and the same ``after``, nan where
            there is none; ``channel_noise``.
    """

    verdict: Verdict
    evidence: Evidence
    shown: ShownFile
    arrays: dict[str, Any]

    @property
    def has_after(self) -> bool:
        """Whether there are FRFs with the effect."""
        return bool(self.arrays["after"].size)


def gather(found: Diagnosis, not_held: Sequence[NotHeld] = ()) -> Result:
    """Put together what a diagnosis found.

    Args:
        found: the diagnosis.
        not_held: by the augmented MJCF.
    """
    verdict = verdict_of(found)
    campaign, machine = found.retuned.campaign, found.session.model.machine
    gaps = found.retuned.channels
    cells = list(zip(gaps.tests, gaps.outputs, strict=True))
    frfs, corrected = _frfs(found, cells)
    row, drawn = machine_rows(machine.layout, looks(machine))
    locations = [one.location for one in verdict.causes]
    locations += [one.location for one in verdict.where]
    locations += [one.location for one in found.evidence.pushed]
    freq = campaign.freq_hz
    said = [*([pulled] if (pulled := pulled_sentence(verdict, found)) else []), *unfinished(found)]
    shown = ShownFile(
        campaign=campaign.name,
        model=machine.name,
        quantity=campaign.tests[0].estimate.frf.quantity,
        band=(float(freq[0]), float(freq[-1])),
        lines=len(freq),
        block=found.retuned.width,
        tests=_tests(campaign),
        channels=[
            ChannelRow(output=str(dof), body=campaign.layout.body_name(dof.point), test=test)
            for test, dof in cells
        ],
        corrected=corrected,
        steps=StepsRow(**step_intervals(found)),
        centres=_centres(found),
        means=[_means(one) for one in verdict.causes],
        solid=[check.words for check in found.gate.checks],
        taken_out=[fault_row(one) for one in found.gate.faults if "sensor:" in one.location],
        doubted=[check.body for check in found.gate.flexible],
        remarks=[*campaign.remarks, *said],
        machine=row,
        places={name: place_row(name, machine) for name in dict.fromkeys(locations)},
        inputs=inputs(found.session),
        not_held_by_mjcf=[str(one) for one in not_held],
    )
    return Result(verdict, found.evidence, shown, {"freq_hz": freq, **frfs, **drawn})


def unfinished(found: Diagnosis) -> list[str]:
    """Which of the fits that figures come from did not go to their end."""
    said = []
    if found.known is not None and not found.known.converged:
        said.append("The fit that sizes are stated from did not end: they may be farther off.")
    levels = (("re-tuned", found.retuned), ("with the cause", found.after))
    short = [f"{one.unfinished} {name}" for name, one in levels if one and one.unfinished]
    if short:
        said.append(f"Held-out fits that did not end: {', '.join(short)}; so gaps may be smaller.")
    return said


def _centres(found: Diagnosis) -> list[CentresRow]:
    """The gap at the centres of mass: as drawn on all lines, then on held-out ones."""
    model, campaign = found.session.model, found.session.campaign
    steps = [(STEPS[0], predict(model, model.drawn, campaign), campaign)]
    levels = (found.retuned, *((found.after,) if found.after else ()))
    steps += [
        (name, level.predicted, level.campaign)
        for name, level in zip(STEPS[1:], levels, strict=False)
    ]
    gaps = [(name, gap_at_bodies(predicted, seen)) for name, predicted, seen in steps]
    return [
        CentresRow(name=name, error=gap.error, excess=gap.excess, channels=gap.channels)
        for name, gap in gaps
    ]


def _means(row: CauseRow) -> str:
    effect = catalogue().get(row.effect) or PROVEN.get(row.effect)
    return effect.said(effect.means, row.location, row.dof) if effect else ""


def _frfs(found: Diagnosis, cells: Sequence[Cell]) -> tuple[dict[str, Any], list[int]]:
    """Arrays by channel, and the channels that the effect corrects."""
    retuned, after = found.retuned, found.after
    measured = _columns(_measured(retuned), retuned, cells)
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
    seen = _columns(_measured(after), after, cells)
    corrected = np.flatnonzero((seen != measured).any(axis=0))
    arrays["after"] = _columns(after.predicted, after, cells).astype(np.complex64)
    arrays["corrected"] = seen[:, corrected].astype(np.complex64)
    return arrays, corrected.tolist()


def _measured(level: Level) -> list[Complex]:
    return [test.estimate.frf.values for test in level.campaign.tests]


def _columns(values: Sequence[Any], level: Level, cells: Sequence[Cell]) -> Any:
    """Values of each test, channel beside channel; (n_freq, n_channel)."""
    outputs = [test.estimate.frf.outputs for test in level.campaign.tests]
    columns: list[Complex] = [values[test][:, outputs[test].index(dof), 0] for test, dof in cells]
    return np.stack(columns, axis=1) if columns else np.zeros((len(level.campaign.freq_hz), 0))


def _gaps(name: str, level: Level | None, cells: Sequence[Cell]) -> dict[str, Any]:
    """Error and excess of each channel."""
    error, excess = np.full((2, len(cells)), np.nan)
    if level is not None:
        gaps = level.channels
        known = {cell: k for k, cell in enumerate(zip(gaps.tests, gaps.outputs, strict=True))}
        for at, cell in enumerate(cells):
            if cell in known:
                k = known[cell]
                error[at] = gaps.error[k]
                excess[at] = gaps.error[k] / gaps.noise[k] if gaps.noise[k] > 0 else np.nan
    return {f"{name}_error": error, f"{name}_excess": excess}


def _tests(campaign: Campaign) -> list[TestRow]:
    conditions = [test.condition for test in campaign.tests]
    return [
        TestRow(
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
    """The reference, and as much of level, set-up and file as tells tests apart."""
    levels = {one.level_n for one in conditions}
    setups = {one.setup for one in conditions}
    labels = [
        str(one.reference)
        + (f", {one.level_n:g} N" if len(levels) > 1 and one.level_n is not None else "")
        + (f", set-up {one.setup}" if len(setups) > 1 and one.setup is not None else "")
        for one in conditions
    ]
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label} in {one.test}" for label, one in zip(labels, conditions, strict=True)]
