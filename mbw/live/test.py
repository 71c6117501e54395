"""A hammer test while it runs: files, hits, what the user decided, and how the hits are judged.

The folder of the test is only read. All hits are judged together whenever one has come
(``identification.hits.judging``); the sheet is a function of files, decisions and model.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from identification.campaign_reader import name_sites
from identification.hits.hit_frfs import KeptEstimates, estimate_hit_frfs
from identification.hits.judging import HitsToJudge, PredictPlaces, judge_hits
from identification.readers.campaign_toml import CampaignSettings, TestSettings
from identification.readers.channel_labels import parse_references
from identification.record_tests import hit_settings, read_records
from identification.words import HitEstimate, InputError, Layout, Port, Records, WorkbenchError

MIN_HITS = 3  # at each place and direction: with fewer, no outlier is told from the others
_MIN_LENGTH_SHARE = 0.5  # of the median record: shorter ones are cut off
Place = tuple[int, Port]  # number of the [[test]], and reference


@dataclass(frozen=True)
class HitRow:
    """A hit on the sheet.

    Args:
        key: name by which it is taken back or withdrawn: its file, and its number there from 2 on.
        place: where it belongs.
        peak_n: largest force of the hit, signed [N].
        reason: why it was refused; None if nothing speaks against it.
        decision: what the user decided; None for nothing.
        is_cut_off: whether its block leaves the record, so that it cannot count.
    """

    key: str
    place: Place
    peak_n: float
    reason: str | None
    decision: bool | None
    is_cut_off: bool = False

    @property
    def is_accepted(self) -> bool:
        """Whether it counts."""
        decision = self.reason is None if self.decision is None else self.decision
        return decision and not self.is_cut_off


@dataclass(frozen=True, eq=False)
class Sheet:
    """All hits of the test so far.

    Args:
        places: places and directions, planned ones first.
        hits: hits, by the order of their files.
        estimates: FRFs of the accepted hits of each place.
        records: records of each place, which hold all hits.
        remarks: what is no matter of single hits.
    """

    places: tuple[Place, ...]
    hits: tuple[HitRow, ...] = ()
    estimates: Mapping[Place, HitEstimate] = field(default_factory=dict)
    records: Mapping[Place, Records] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def list_accepted(self, place: Place) -> list[HitRow]:
        """Return the hits at a place that count."""
        return [hit for hit in self.hits if hit.place == place and hit.is_accepted]

    @property
    def complete(self) -> list[Place]:
        """Places with enough hits."""
        return [place for place in self.places if len(self.list_accepted(place)) >= MIN_HITS]


@dataclass(eq=False)
class LiveTest:
    """Files and decisions of a test that runs.

    Args:
        source, settings: campaign.toml, as ``read_settings`` returns it.
        layout: bodies and points, corrected as campaign.toml states.
    """

    source: Path
    settings: CampaignSettings
    layout: Layout
    decisions: dict[str, bool] = field(default_factory=dict)
    _files: dict[Path, list[tuple[int, Records]]] = field(default_factory=dict)
    _joined: dict[tuple[str, tuple[Records, ...]], Records] = field(default_factory=dict)
    _estimates: KeptEstimates = field(default_factory=KeptEstimates)

    @property
    def patterns(self) -> list[str]:
        """Names and patterns of the files of the test."""
        return [entry.file for entry in self.settings.test]

    @property
    def planned(self) -> list[Place]:
        """Places and directions that campaign.toml names."""
        places = []
        for number, entry in enumerate(self.settings.test):
            if entry.references:
                stated = parse_references(self.source, entry.references)
                _, references = name_sites(self.layout, self.source, (), stated)
                places += [(number, reference) for reference in references]
        return places

    def read(self, path: Path) -> list[tuple[int, Records]]:
        """Return the records of a file, with the number of their [[test]].

        Raises:
            InputError: the file cannot be used.
        """
        records, file = [], path.relative_to(self.source.parent)
        for number, entry in enumerate(self.settings.test):
            if len(file.parts) == len(Path(entry.file).parts) and file.match(entry.file):
                named = entry.model_copy(update={"file": str(file)})
                naming = partial(name_sites, self.layout)
                for each in read_records(self.source, named, self.settings.sensor, naming):
                    records.append((number, each))
        if not records:
            raise InputError(
                "it holds FRFs, and a live test needs the records of hits in time: export force "
                "and motion over time, or give the FRFs to mbw diagnose"
            )
        for number, each in records:
            judge_hits([self._to_judge(number, each)])  # refuses a force without hits
        return records

    def add(self, path: Path, records: list[tuple[int, Records]]) -> None:
        """Take the records of a file, new or anew."""
        self._files[path] = records

    def drop(self, path: Path) -> None:
        """Take a file off that is no longer there."""
        self._files.pop(path, None)

    def judge(self, predict: PredictPlaces | None = None) -> Sheet:
        """Judge all hits, and estimate the FRFs of the accepted ones.

        Args:
            predict: FRFs of the model (``judge_hits``).
        """
        series, remarks = self._join()
        places = tuple(dict.fromkeys([*self.planned, *series]))
        if not series:
            return Sheet(places)
        tests = [self._to_judge(place[0], records) for place, (records, _) in series.items()]
        judgement = judge_hits(tests, predict)
        rows: dict[Place, list[HitRow]] = {}
        of_files: dict[Path, list[HitRow]] = {path: [] for path in self._files}
        for (place, (_, files)), hits in zip(series.items(), judgement.hits, strict=True):
            rows[place] = []
            for hit in hits:
                path = files[hit.record - 1]
                # The first one keeps its name when the file grows, and with it what was decided.
                key = path.relative_to(self.source.parent).as_posix()
                key += f"#{len(of_files[path]) + 1}" if of_files[path] else ""
                decision = self.decisions.get(key)
                row = HitRow(key, place, hit.peak_n, hit.reason, decision, hit.is_cut_off)
                rows[place].append(row)
                of_files[path].append(row)
        chosen = [
            (place, test, rows[place])
            for place, test in zip(series, tests, strict=True)
            if any(hit.is_accepted for hit in rows[place])
        ]
        estimates, failures = _estimate(chosen, self._estimates)
        sheet_hits = tuple(row for of_file in of_files.values() for row in of_file)
        joined = {place: records for place, (records, _) in series.items()}
        remarks = [*remarks, *judgement.remarks, *failures]
        return Sheet(places, sheet_hits, estimates, joined, tuple(dict.fromkeys(remarks)))

    def _to_judge(self, number: int, records: Records) -> HitsToJudge:
        entry = self.settings.test[number]
        return HitsToJudge(records, hit_settings(entry), entry.level)

    def _join(self) -> tuple[dict[Place, tuple[Records, list[Path]]], list[str]]:
        """Return the records of each place with the file of each record, and remarks.

        Longer records are cut to the shortest one; a record far shorter than usual does not count.
        Where nothing came or went, the records are the same object as before.
        """
        groups: dict[Place, list[tuple[Path, Records]]] = {}
        rates = Counter(each.rate_hz for of_file in self._files.values() for _, each in of_file)
        series: dict[Place, tuple[Records, list[Path]]] = {}
        joined: dict[tuple[str, tuple[Records, ...]], Records] = {}
        remarks: list[str] = []
        for path, contents in self._files.items():
            for number, records in contents:
                remarks += records.remarks
                if records.rate_hz == (rate := rates.most_common(1)[0][0]):
                    groups.setdefault((number, records.reference), []).append((path, records))
                else:
                    sampled = f"it was sampled at {records.rate_hz:g} Hz, others at {rate:g} Hz"
                    remarks.append(f"{path.name} is not counted: {sampled}")
        for place, members in groups.items():
            lengths = [records.force.shape[1] for _, records in members]
            usual, first = float(np.median(lengths)), members[0][1]
            kept = []
            for path, records in members:
                reason = _differs(records, first, usual)
                if reason:
                    remarks.append(f"{path.name} is not counted: {reason}")
                else:
                    kept.append((path, records))
            if not kept:
                continue
            files = [path for path, records in kept for _ in range(len(records.force))]
            key = self.settings.test[place[0]].file, tuple(records for _, records in kept)
            joined[key] = self._joined.get(key) or _concatenate(*key)
            series[place] = joined[key], files
        self._joined = joined
        return series, remarks


def _concatenate(name: str, members: tuple[Records, ...]) -> Records:
    """Return the records of one place as one, cut to the shortest."""
    size = min(records.force.shape[1] for records in members)
    return replace(
        members[0],
        force=np.concatenate([records.force[:, :size] for records in members]),
        motion=np.concatenate([records.motion[:, :, :size] for records in members]),
        test=name,
    )


def _differs(records: Records, first: Records, usual: float) -> str | None:
    """Return why a record cannot stand beside others of its place, or None."""
    if records.outputs != first.outputs:
        return "its channels are not those of the first hit there"
    if records.force.shape[1] < _MIN_LENGTH_SHARE * usual:
        return f"it has {records.force.shape[1]} samples, others {usual:.0f}"
    return None


def _estimate(
    chosen: list[tuple[Place, HitsToJudge, list[HitRow]]], kept: KeptEstimates
) -> tuple[dict[Place, HitEstimate], list[str]]:
    """Return the FRFs of the accepted hits, and sentences on what they cannot be estimated of."""
    settings = [
        replace(
            test.settings,
            reject=False,
            left_out=frozenset(n for n, hit in enumerate(rows, start=1) if not hit.is_accepted),
        )
        for _, test, rows in chosen
    ]
    if not chosen:
        return {}, []
    try:
        estimates = estimate_hit_frfs([test.records for _, test, _ in chosen], settings, kept)
    except WorkbenchError as error:
        return {}, [str(error)]
    return {place: hits for (place, *_), hits in zip(chosen, estimates, strict=True)}, []


def entry_of(settings: CampaignSettings, place: Place) -> TestSettings:
    """Return the [[test]] of a place."""
    return settings.test[place[0]]


def describe_place(settings: CampaignSettings, place: Place) -> str:
    """Return a place and direction, with the level where tests differ in it."""
    levels = {entry.level for entry in settings.test}
    level = entry_of(settings, place).level
    return f"{place[1]} at {level:g} N" if len(levels) > 1 and level else str(place[1])
