"""Tests beside each other, and the change of the machine between two of them."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagnosis.between_visits import VISIT_PRIORS
from diagnosis.verdict.sentences import change_sentence
from identification.comparison import (
    CellDifference,
    FleetScatter,
    Shift,
    TestComparison,
    VisitDrift,
    compare_frfs,
    compare_tests,
    compute_scatter,
    compute_shifts,
    describe_fleet,
    describe_shifts,
    name_campaigns,
)
from identification.words import InputError, UsageError
from mbworkbench.campaign import MeasuredCampaign, read_campaign, select_band
from mbworkbench.diagnosis import DiagnosisResult, diagnose
from mbworkbench.labels import AnyPath, check_count
from mbworkbench.tables import Shown, Table
from tuning.files.states_campaign import find_differences, write_states_campaign


@dataclass(frozen=True, eq=False)
class ComparisonResult(Shown):
    """Modes and FRFs of several tests, and the diagnosis of the change between two.

    Attributes:
        tests: modes of all tests, paired, and their FRFs.
        two_machines: whether two tests are of two machines of one drawing.
        diagnosis: verdict on the change; None for a fleet, or without a diagnosis.
    """

    tests: TestComparison
    two_machines: bool = False
    diagnosis: DiagnosisResult | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tests."""
        return self.tests.names

    @property
    def is_fleet(self) -> bool:
        """Whether there are more than two tests."""
        return len(self.names) > 2

    @property
    def shifts(self) -> list[tuple[Shift, Shift] | None]:
        """Shift of frequency [Hz] and damping ratio of each mode; None for an unpaired mode.

        Raises:
            UsageError: there are more than two tests.
        """
        if self.is_fleet:
            raise UsageError("a fleet has no shifts: its scatter stands in .table()")
        is_same = not self.two_machines
        drift = VisitDrift(VISIT_PRIORS.stiffness / 2, VISIT_PRIORS.damping)
        return compute_shifts(self.tests.modes, drift if is_same else VisitDrift())

    @property
    def frf_differences(self) -> tuple[CellDifference, ...]:
        """Difference of each FRF of two tests over the noise, largest first.

        Raises:
            UsageError: there are more than two tests.
        """
        if self.is_fleet:
            raise UsageError("a fleet has no differences of two FRFs: compare two of its tests")
        return compare_frfs(self.tests)

    @property
    def sentence(self) -> str:
        """Sentence on the diagnosed change, if there is one, and on the modes."""
        modes, names = self.tests.modes, self.names
        if self.is_fleet:
            return describe_fleet(modes, self._scatter("freq_hz", "freq_sd"), names)
        is_same = not self.two_machines
        text = describe_shifts(modes, self.shifts, names, is_one_machine=is_same)
        if self.diagnosis is None:
            return text
        return f"{change_sentence(self.diagnosis.verdict)} {text}"

    def _scatter(self, value: str, deviation: str) -> FleetScatter:
        """Return the scatter of a number of all modes over the tests."""
        pair = (np.array([getattr(m, n) for m in self.tests.modes]) for n in (value, deviation))
        return compute_scatter(*pair)

    def __repr__(self) -> str:
        """Return the tests and the sentence in two lines."""
        return f"{', '.join(self.names)}:\n  {self.sentence}"

    def table(self) -> Table:
        """Return the modes: with shifts of two tests, with the scatter of a fleet."""
        title = f"{', '.join(self.names)}: {self.sentence}"
        return Table(title, *(self._fleet_rows() if self.is_fleet else self._pair_rows()))

    def _pair_rows(self) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
        """Return header and rows of two tests."""
        first, second = self.names
        header = (
            *(f"{first} [Hz]", f"{second} [Hz]", "shift [Hz]", "sd [Hz]", "changed"),
            *(f"{first} damping [%]", f"{second} damping [%]", "shift [%]", "sd [%]"),
            *("damping changed", "MAC"),
        )
        rows: list[tuple[object, ...]] = []
        for mode, shift in zip(self.tests.modes, self.shifts, strict=True):
            frequency, damping = shift or (None, None)
            rows.append(
                (
                    *map(_none_if_nan, mode.freq_hz),
                    *_shift_cells(frequency, 1.0),
                    *map(_none_if_nan, 100 * mode.damping),
                    *_shift_cells(damping, 100.0),
                    None if shift is None else float(mode.mac[1]),
                )
            )
        return header, rows

    def _fleet_rows(self) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
        """Return header and rows of a fleet."""
        scatter = self._scatter("freq_hz", "freq_sd")
        header = ("mean [Hz]", "spread [Hz]", "within a test [Hz]", "tests", "stand out")
        rows: list[tuple[object, ...]] = [
            (
                float(scatter.mean[k]),
                _none_if_nan(scatter.spread[k]),
                float(scatter.within[k]),
                int((mode.number >= 0).sum()),
                ", ".join(self.names[n] for n in np.flatnonzero(scatter.stands_out[k]).tolist()),
            )
            for k, mode in enumerate(self.tests.modes)
        ]
        return header, rows


def _none_if_nan(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _shift_cells(shift: Shift | None, unit: float) -> tuple[object, ...]:
    if shift is None:
        return (None, None, None)
    return unit * shift.value, unit * shift.deviation, shift.is_change


def compare(
    *campaigns: MeasuredCampaign | AnyPath,
    two_machines: bool = False,
    diagnosis: bool = True,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> ComparisonResult:
    """Compare tests: of one machine before and after, of two machines, or of a fleet.

    Args:
        campaigns: two or more, from ``read_campaign`` or paths of folders; of two, the first is
            before a change.
        two_machines: whether two campaigns are of two machines of one drawing, not of one machine.
        diagnosis: whether the change between two campaigns is diagnosed; a fleet never is.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.
        jobs: number of processes of the diagnosis.
        progress: called with the current step of the diagnosis, in words.

    Raises:
        InputError: a campaign cannot be used, they share no channel or lines, or, with a diagnosis,
            one of them has no model or they differ beside their tests.
        UsageError: fewer than two campaigns, or an argument out of its range.
    """
    check_count("jobs", jobs)
    if len(campaigns) < 2:
        raise UsageError("a comparison needs two campaigns or more: call compare(before, after)")
    opened = [c if isinstance(c, MeasuredCampaign) else read_campaign(c) for c in campaigns]
    names = name_campaigns([each.source for each in opened])
    tests = compare_tests([select_band(each, band) for each in opened], names)
    result = ComparisonResult(tests, two_machines)
    if result.is_fleet or not diagnosis:
        return result
    first, second = (each.source for each in opened)
    if keys := find_differences(first, second):
        raise InputError(
            f"beside the tests, {first} and {second} differ in {', '.join(keys)}: make them agree, "
            "or compare with diagnosis=False"
        )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve() / f"{tests.names[0]}-{tests.names[1]}"
        folder.mkdir()
        write_states_campaign(first, second, folder, folder, two_machines=two_machines)
        verdict = diagnose(folder, band=band, jobs=jobs, progress=progress)
    return ComparisonResult(tests, two_machines, verdict)
