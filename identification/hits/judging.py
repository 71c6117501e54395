"""Judgement of each hit while a test runs: accepted, or why not.

Hits are judged together whenever one has come, so that a later hit can clear or convict an earlier
one. The checks are those of every test (``rejection``), with three more between them: a hit far
weaker than planned, another place or direction, and channels (``comparison``). A fault of a channel
counts against a hit if most comparisons show it, with the model and with each other hit there.
What the model shows in most hits of the test is no fault of a hit but of model or sensor, and
becomes a remark. So does another place that it shows in most of three hits at a place.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from identification.hits.blocks import Blocks, cut_blocks, plan_blocks
from identification.hits.comparison import (
    LOOSE,
    ChannelComparison,
    ComparedHit,
    CompareWindow,
    Fault,
    Places,
    compared_hits,
    describe_fault,
    find_loose_channels,
    find_other_place,
    quiet_levels,
)
from identification.hits.detection import Blow, find_blows
from identification.hits.hit_frfs import hit_spectra
from identification.hits.outliers import Reasons
from identification.hits.rejection import MIN_PEAK, reject_hits
from identification.hits.settings import HitSettings
from identification.words import Dof, Output, Real, Records

# Time constants of comparisons over the median pulse width. Springs hardly act within half a pulse:
# those of a nominal model are uncertain by factors, and a tuned one may lack something. So short a
# window has few samples, in which two hits differ by when they began between two of them.
_MODEL_TAU_WIDTHS, _HITS_TAU_WIDTHS = 0.5, 2.0
_MIN_PLANNED_PEAK_HITS = 3  # with fewer hits, they are weak against the planned peak
_MIN_COMMON_HITS = 3  # that agree at a place, against the model

PredictPlaces = Callable[[CompareWindow, tuple[Output, ...]], Places]


@dataclass(frozen=True, eq=False)
class HitsToJudge:
    """Hits at one place and direction.

    Args:
        records: records of force and motion.
        settings: settings of the campaign for them.
        peak_n: planned peak force [N]; None if unknown.
    """

    records: Records
    settings: HitSettings = field(default_factory=HitSettings)
    peak_n: float | None = None


@dataclass(frozen=True)
class JudgedHit:
    """A hit and what speaks against it.

    Args:
        record, number, time_s, peak_n: as for ``Hit``.
        reason: reason to refuse it; None if it is accepted.
        is_cut_off: whether its block leaves the record.
    """

    record: int
    number: int
    time_s: float
    peak_n: float
    reason: str | None
    is_cut_off: bool


@dataclass(frozen=True, eq=False)
class Judgement:
    """All hits of a test as they are judged together.

    Args:
        hits: hits of each reference.
        remarks: faults that are no matter of single hits.
    """

    hits: tuple[tuple[JudgedHit, ...], ...]
    remarks: tuple[str, ...]


def judge_hits(tests: Sequence[HitsToJudge], predict: PredictPlaces | None = None) -> Judgement:
    """Judge all hits of a test.

    Args:
        tests: hits of each place and direction, in the order of the test.
        predict: function that returns the FRFs of a model for each place and direction that may
            have been hit, along its positive axis, on lines and with the window of a comparison;
            None without a model.

    Raises:
        InputError: a record has no hits, or sampling rates or settings contradict one another.
    """
    records = [test.records for test in tests]
    blows = [find_blows(each) for each in records]
    plan = plan_blocks(records, blows, [test.settings for test in tests])
    cut = [cut_blocks(each, hits, plan) for each, hits in zip(records, blows, strict=True)]
    rate = records[0].rate_hz
    width = float(np.median([blow.main.width for hits in blows for blow in hits])) / rate
    of_hits = CompareWindow(width * _HITS_TAU_WIDTHS, rate)
    of_model = CompareWindow(width * _MODEL_TAU_WIDTHS, rate)
    series = [_Series.of(blocks, (of_model, of_hits), predict) for blocks, _ in cut]
    common = _find_common_faults(series)
    quiet: dict[tuple[Output, ...], Real] = {}
    for each in series:
        outputs = each.blocks.records.outputs
        quiet[outputs] = np.vstack([quiet.get(outputs, each.quiet[:0]), each.quiet])
    measured: dict[Dof, list[ComparedHit]] = {}
    judged, remarks = [], []
    for test, each, (blocks, left_out), hits in zip(tests, series, cut, blows, strict=True):
        elsewhere = {
            dof: np.mean([hit.frf for hit in group], axis=0)
            for dof, group in measured.items()
            if group[0].motion.shape[1:] == (len(test.records.outputs),)
        }
        usual = quiet[test.records.outputs]
        checks = [
            partial(_find_weak, peak_n=test.peak_n),
            partial(each.find_places, elsewhere=elsewhere),
            partial(each.find_channel_faults, common=common, usual=usual),
        ]
        kept, refused = blocks, left_out
        if test.settings.reject and blocks.blows:
            spectra = partial(hit_spectra, settings=test.settings)
            kept, rejected = reject_hits(blocks, spectra, checks)
            refused = (*left_out, *rejected)
        reasons = {rejection.hit: rejection.reason for rejection in refused}
        cut_off = {rejection.hit for rejection in left_out}
        judged.append(tuple(_describe_hit(blow, reasons, cut_off, rate) for blow in hits))
        dof = test.records.reference
        if kept.blows and isinstance(dof, Dof):
            measured.setdefault(dof, []).extend(each.select(kept))
        if (place := each.find_common_place(kept)) is not None:
            remarks.append(
                f"hits at {dof} look like hits at {place}: see where they are, or the "
                "model lacks something"
            )
    remarks += [
        f"{describe_fault(fault, outputs)} in most hits: a sensor, or what the model lacks"
        for outputs, fault in common
    ]
    return Judgement(tuple(judged), tuple(dict.fromkeys(remarks)))


def _describe_hit(
    blow: Blow, reasons: Mapping[int, str], cut_off: set[int], rate_hz: float
) -> JudgedHit:
    number, main = blow.number, blow.main
    where = main.record + 1, number, blow.onset / rate_hz, main.height
    return JudgedHit(*where, reasons.get(number), number in cut_off)


def _find_weak(blocks: Blocks, peak_n: float | None) -> Reasons:
    """Find weak hits among a few, which have no median that counts."""
    if peak_n is None or len(blocks.blows) >= _MIN_PLANNED_PEAK_HITS:
        return [None] * len(blocks.blows)
    shares = [abs(blow.main.height) / peak_n for blow in blocks.blows]
    return [
        f"weak: {share:.2g} times the planned peak" if share < MIN_PEAK else None
        for share in shares
    ]


@dataclass(frozen=True, eq=False)
class _Series:
    """Hits of one reference on the lines of a comparison.

    Args:
        blocks: all of its blocks.
        for_model: their spectra with the window of the model.
        hits: their spectra with the window of other hits.
        model: FRFs of the model for all places; empty without one.
        by_model: channels of each hit beside those of the model; empty without one.
        quiet: rms of the channels before each hit; (n_hit, n_out).
    """

    blocks: Blocks
    for_model: list[ComparedHit]
    hits: list[ComparedHit]
    model: Places
    by_model: list[ChannelComparison]
    quiet: Real

    @classmethod
    def of(
        cls,
        blocks: Blocks,
        windows: tuple[CompareWindow, CompareWindow],
        predict: PredictPlaces | None,
    ) -> "_Series":
        """Compare the hits of one reference with a model."""
        for_model, hits = (compared_hits(blocks, window) for window in windows)
        reference = blocks.records.reference
        model: Places = {} if predict is None else predict(windows[0], blocks.records.outputs)
        compared: list[ChannelComparison] = []
        if isinstance(reference, Dof):
            sign = reference.sign
            model = {_along(dof, reference): frf for dof, frf in model.items()}
            model = {
                dof: sign * frf if dof == reference and sign < 0 else frf
                for dof, frf in model.items()
            }
            if reference in model:
                compared = [ChannelComparison(hit, model[reference]) for hit in for_model]
        return cls(blocks, for_model, hits, model, compared, quiet_levels(blocks))

    def _rows(self, blocks: Blocks) -> list[int]:
        """Return the places of some blocks among all."""
        numbers = [blow.number for blow in self.blocks.blows]
        return [numbers.index(blow.number) for blow in blocks.blows]

    def select(self, blocks: Blocks) -> list[ComparedHit]:
        """Return the spectra of some blocks."""
        return [self.hits[row] for row in self._rows(blocks)]

    def _find_places_alone(self, blocks: Blocks) -> list[Dof | None]:
        """Return where the model sees each hit, if not at the stated place."""
        stated = self.blocks.records.reference
        if not isinstance(stated, Dof):
            return [None] * len(blocks.blows)
        return [
            find_other_place((self.for_model[row], self.hits[row]), stated, self.model, (), {})
            for row in self._rows(blocks)
        ]

    def find_common_place(self, blocks: Blocks) -> Dof | None:
        """Return where the model sees most of several hits, if not at the stated place.

        Whoever was told so twice and hits there again means it: the model may lack something.
        """
        seen = self._find_places_alone(blocks)
        common, count = Counter(seen).most_common(1)[0] if seen else (None, 0)
        return common if count >= max(_MIN_COMMON_HITS, len(seen) // 2 + 1) else None

    def find_places(self, blocks: Blocks, elsewhere: Places) -> Reasons:
        """Return why hits were made at another place or along another direction."""
        stated = self.blocks.records.reference
        if not isinstance(stated, Dof):
            return [None] * len(blocks.blows)
        hits = [(self.for_model[row], self.hits[row]) for row in self._rows(blocks)]
        seen = self._find_places_alone(blocks)
        alone = [place in (None, self.find_common_place(blocks)) for place in seen]
        reasons: Reasons = []
        for number, hit in enumerate(hits):
            companions = [each.frf for k, (_, each) in enumerate(hits) if alone[k] and k != number]
            place = find_other_place(hit, stated, self.model, companions, elsewhere)
            reasons.append(
                None if place is None else f"looks like a hit at {place}, not at {stated}"
            )
        return reasons

    def find_channel_faults(
        self, blocks: Blocks, common: set["_CommonFault"], usual: Real
    ) -> Reasons:
        """Return which channel speaks against hits.

        Args:
            blocks: some of the blocks.
            common: faults that are no matter of single hits.
            usual: rms of the channels before all hits; (n_all, n_out).
        """
        rows, outputs = self._rows(blocks), self.blocks.records.outputs
        reasons: Reasons = []
        for row in rows:
            compared = [
                ChannelComparison(self.hits[row], self.hits[k].frf) for k in rows if k != row
            ]
            compared += self.by_model[row : row + 1]
            candidates = {fault for each in compared for fault in each.find_faults()}
            faults = [
                fault
                for fault in sorted(candidates)
                if (outputs, fault) not in common and _most_lean_to(fault, compared)
            ]
            faults += [(LOOSE, (k,)) for k in find_loose_channels(self.quiet[row], usual)]
            reasons.append(describe_fault(faults[0], outputs) if faults else None)
        return reasons


def _most_lean_to(fault: Fault, compared: Sequence[ChannelComparison]) -> bool:
    """Return whether a fault fits better in most of the comparisons that can judge it."""
    able = [each.leans_to(fault) for each in compared if each.channels >= set(fault[1])]
    return sum(able) > len(able) / 2


_CommonFault = tuple[tuple[Output, ...], Fault]


def _find_common_faults(series: Sequence[_Series]) -> set[_CommonFault]:
    """Return what the model shows in most of several hits that can show it."""
    shown: Counter[_CommonFault] = Counter()
    for each in series:
        outputs = each.blocks.records.outputs
        shown.update((outputs, fault) for hit in each.by_model for fault in hit.find_faults())
    possible = {
        (outputs, fault): sum(
            hit.channels >= set(fault[1])
            for each in series
            if each.blocks.records.outputs == outputs
            for hit in each.by_model
        )
        for outputs, fault in shown
    }
    return {fault for fault, n in shown.items() if n > 1 and n > possible[fault] / 2}


def _along(dof: Dof, reference: Dof) -> Dof:
    """Return a place and direction with the sign of the reference, if it is the same."""
    return reference if dof.positive == reference.positive else dof
