"""Causes that the verdict names, what each closes, and what remains: the verdict's word.

A cause is established if it is probable, closes a fifth of the gap, and its size is one
(``profiled_sizes``): materiality, not significance alone. With e(S) the mean square of the gap of
the set S over that of the noise, the cause c_k of the causes c_1 .. c_n of a set, in the order of
their selection, closes the larger of

    1 - e(c_1 .. c_k) / e(c_1 .. c_k-1),    1 - e(S) / e(S without c_k)

of the gap that remains without it. By the second alone, neither of two similar causes would close
anything. Where next to nothing remains without it, the gap of the null model counts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from diagnosis.decision.closed_by_proven import find_closed_by_proven
from diagnosis.decision.remaining_gap import RestRow, describe_rest
from diagnosis.estimates.held_out_gap import GapEstimates
from diagnosis.estimates.profiled_sizes import find_named_size
from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import Evidence, Key, NamedRow, read_site
from diagnosis.inference.posterior import Posterior
from diagnosis.null_model import Baseline
from diagnosis.refits.refit import Refit
from diagnosis.search.fitted_sets import Search
from diagnosis.settings import DiagnosisSettings
from diagnosis.stated_values import Ends
from tuning import is_gap_visible

Word = Literal["none", "explained", "several", "partly", "unexplained"]


class RemarkRow(NamedRow):
    """Proven fault that is not established, with the part of the gap that it closes alone."""

    closed: float | None


@dataclass(frozen=True, eq=False)
class Present:
    """Causes that the verdict names.

    Args:
        word: verdict.
        causes: probable causes, those that redundant channels prove first.
        closes: part of the gap that remains without it that each closes, by its key.
        established: keys of those that close enough.
        remarks: proven faults that are not established.
        rest: what remains.
        intervals: 95 % intervals of the parameters of the causes that close enough, by their keys.
    """

    word: Word
    causes: tuple[Hypothesis, ...]
    closes: Mapping[Key, float]
    established: tuple[Key, ...]
    remarks: list[RemarkRow]
    rest: RestRow
    intervals: Mapping[Key, Mapping[str, Ends]] = field(default_factory=dict)


def find_present(
    search: Search, evidence: Evidence, posterior: Posterior, settings: DiagnosisSettings
) -> Refit:
    """Return the refit of the most probable set whose causes are all probable; else the null model.

    Args:
        evidence: which sets held-out lines reject.
        posterior: their probabilities.
        settings: least probability.
    """
    probability = {read_site(key): share for key, share in posterior.causes}

    def is_probable(refit: Refit) -> bool:
        is_admitted = bool(refit.causes) and evidence.admits(refit.keys)
        return is_admitted and all(
            probability.get(read_site(key), 0.0) >= settings.min_probability for key in refit.keys
        )

    candidates = [refit for refit in search.refits if is_probable(refit)]
    most = max((len(refit.causes) for refit in candidates), default=0)
    largest = [refit for refit in candidates if len(refit.causes) == most]
    return min(largest, key=lambda refit: refit.objective, default=search.null)


def is_nothing_missing(posterior: Posterior) -> bool:
    """Return whether no hypothesis is more probable than that nothing is missing.

    Where hits of a test differ, the posterior holds "none" at most as probable as "unexplained".
    Equal probabilities then mean that the gap is not significant.

    Args:
        posterior: probabilities of all sets of causes.
    """
    of_causes = 1 - posterior.none - posterior.unexplained
    return posterior.none >= max(posterior.unexplained, of_causes)


def describe_present(
    base: Baseline,
    search: Search,
    evidence: Evidence,
    posterior: Posterior,
    gaps: GapEstimates,
    settings: DiagnosisSettings,
) -> Present:
    """Return the causes that the verdict names, what each closes, and what remains.

    Args:
        posterior: probabilities of the sets.
        gaps: held-out gaps.
    """
    refit = find_present(search, evidence, posterior, settings)
    closes = find_closed_by_proven(base, gaps) | _find_closed_by_causes(search, refit)
    causes = (*base.proven, *refit.causes)
    enough = [
        cause
        for cause in causes
        if (closes.get(cause.key, 0.0) >= settings.min_closed or not cause.is_modelled)
        # What is proven without a model does not wait for a model that foretells held-out lines.
        and (cause in base.proven or _closes_held_out_gap(gaps, settings))
    ]
    sizes = {
        cause.key: find_named_size(base.scene, gaps.after.refit, gaps.parameters, cause, settings)
        for cause in enough
        if gaps.after and gaps.parameters and cause not in base.proven
    }
    established = tuple(
        cause.key
        for cause in enough
        if cause.key not in sizes or sizes[cause.key].excludes_no_effect
    )
    is_none = not established and is_nothing_missing(posterior)
    rest = describe_rest(evidence, refit, gaps, settings, is_none=is_none)
    if is_none:
        word: Word = "none"
    elif not established:
        word = "unexplained"
    elif rest.significant or evidence.unknown:
        word = "partly"
    else:
        word = "explained" if len(causes) == 1 else "several"
    named = {read_site(cause.key) for cause in causes}
    proven = dict.fromkeys(
        (fault.effect, fault.location, fault.dof) for fault in base.checks.faults
    )
    remarks = [
        RemarkRow(
            effect=key[0],
            location=key[1],
            dof=key[2],
            closed=closes.get(key, _find_closed_alone(search, key)),
        )
        for key in dict.fromkeys(proven)
        if key not in established and read_site(key) not in named
    ]
    intervals = {key: size.intervals for key, size in sizes.items()}
    return Present(word, causes, closes, established, remarks, rest, intervals)


def _find_closed_by_causes(search: Search, refit: Refit) -> dict[Key, float]:
    """Return the part of the gap that remains without it that each cause of a set closes."""

    def find_part(without: Sequence[Key], with_it: Sequence[Key]) -> float:
        before, after = (
            (search.refit_of(keys) or search.null) if keys else search.null
            for keys in (without, with_it)
        )
        whole = before.gap if is_gap_visible(before.gap) else search.null.gap
        return float((before.gap - after.gap) / max(whole, np.finfo(float).tiny))

    closed = {}
    for number, key in enumerate(refit.keys):
        remaining = [cause for cause in refit.keys if cause != key]
        in_turn = find_part(refit.keys[:number], refit.keys[: number + 1])
        closed[key] = max(in_turn, find_part(remaining, refit.keys))
    return closed


def _closes_held_out_gap(gaps: GapEstimates, settings: DiagnosisSettings) -> bool:
    """Return whether all causes together close enough of the gap on held-out lines.

    If the gap is hardly visible on held-out lines, the fits alone decide.
    """
    before = gaps.retuned.gap.excess
    after = None if gaps.after is None else gaps.after.gap.excess
    if before is None or after is None or not is_gap_visible(before**2 - 1):
        return True
    return before**2 - after**2 >= settings.min_closed * (before**2 - 1)


def _find_closed_alone(search: Search, key: Key) -> float | None:
    """Return the part of the gap that a cause closes by itself; None if it was not fitted."""
    refit = search.refit_of((key,))
    if refit is None or search.null.gap <= 0:
        return None
    return float(1 - refit.gap / search.null.gap)
