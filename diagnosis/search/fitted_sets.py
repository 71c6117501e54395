"""Sets of causes that the search has fitted, and which of two it prefers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.inference.calibration import find_variance_source, load_calibration
from diagnosis.inference.evidence import Evidence, ForceGain, Key
from diagnosis.inference.posterior import compute_log_odds, select_material_sets
from diagnosis.refits.refit import Refit, summarise_refit
from diagnosis.search.score_test import Score
from diagnosis.settings import DiagnosisSettings


@dataclass(frozen=True, eq=False)
class Search:
    """Result of the search.

    Args:
        null: null model.
        scores: score tests about the null model, the most promising first.
        refits: sets of causes in the order of their fits.
        selected: selected set of causes; the null model if no cause is probable.
        small_faults: faults that redundant channels prove, but for gross ones.
        forces: free forces about some refits.
    """

    null: Refit
    selected: Refit
    scores: tuple[Score, ...] = ()
    refits: tuple[Refit, ...] = ()
    small_faults: tuple[Key, ...] = ()
    forces: Mapping[Refit, tuple[ForceGain, ...]] = field(default_factory=dict)

    @property
    def hypotheses(self) -> int:
        """Number of effects and places that were scored."""
        return len({score.hypothesis.site for score in self.scores})

    def refit_of(self, keys: Sequence[object]) -> Refit | None:
        """Return the best refit of a set of causes."""
        matching = [refit for refit in self.refits if set(refit.keys) == set(keys)]
        return min(matching, key=lambda refit: refit.objective, default=None)


def is_last_material(search: Search, refit: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether the last cause of a set is material."""
    before = search.refit_of(refit.keys[:-1]) or search.null
    return refit.is_material_step(before, settings.min_closed, search.null)


def is_material(search: Search, refit: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether each cause of a set is material beside the others."""
    sets = [summarise_refit(candidate) for candidate in (*search.refits, refit)]
    material = select_material_sets(summarise_refit(search.null), sets, settings)
    return refit.keys in {fitted.keys for fitted in material}


def is_acceptable(search: Search, refit: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether a set is material, and more probable than the selected one."""
    return is_material(search, refit, settings) and is_more_probable(search, refit, search.selected)


def is_more_probable(search: Search, refit: Refit, base: Refit) -> bool:
    """Return whether the posterior prefers a set to another one."""
    first, second = _compute_log_odds(search, [refit, base], (*search.refits, refit))
    return first > second


def find_most_probable(search: Search, settings: DiagnosisSettings) -> Refit:
    """Return the most probable material set; the selected one if none is more probable."""
    refits = [search.selected, *search.refits]
    logs = _compute_log_odds(search, refits, search.refits)
    better = [number for number, log in enumerate(logs) if log > logs[0]]
    for number in sorted(better, key=lambda number: -logs[number]):
        if is_material(search, refits[number], settings):
            return refits[number]
    return search.selected


def find_leading(search: Search, settings: DiagnosisSettings) -> list[Refit]:
    """Return the most probable refit and those confounded with it, if a verdict would list them.

    Their odds are then at least ``min_row_probability`` relative to no cause.
    """
    logs = _compute_log_odds(search, search.refits, search.refits)
    least = max(max(logs, default=0.0) - settings.twin_nats, np.log(settings.min_row_probability))
    return [refit for refit, log in zip(search.refits, logs, strict=True) if log >= least]


def _compute_log_odds(
    search: Search, chosen: Sequence[Refit], refits: Sequence[Refit]
) -> list[float]:
    """Return the log odds of chosen sets.

    Args:
        search: sets of causes that were fitted.
        chosen: the sets.
        refits: all sets.
    """
    evidence = Evidence(
        small_faults=search.small_faults,
        null=summarise_refit(search.null),
        sets=tuple(map(summarise_refit, refits)),
        hypotheses=search.hypotheses,
        variance=find_variance_source(search.null.session.campaign),
    )
    logs = compute_log_odds(
        evidence, [summarise_refit(refit) for refit in chosen], load_calibration()
    )
    return logs.tolist()
