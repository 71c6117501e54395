"""Sets of causes that the search has fitted, and which of two it prefers.

Confounded causes: equal signatures, equal probabilities, or one effect at several places.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import combinations

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.inference.calibration import find_variance_source, load_calibration
from diagnosis.inference.evidence import Evidence, ForceGain, Key, Site, read_site
from diagnosis.inference.posterior import Posterior, compute_log_odds, select_material_sets
from diagnosis.refits.refit import Refit
from diagnosis.search.score_test import Score, compute_cosines
from diagnosis.settings import DiagnosisSettings
from identification.words import Complex, Real
from tuning import predict, thin_lines
from tuning.misfit.residual_statistics import find_counted_values


@dataclass(frozen=True, eq=False)
class Search:
    """Result of the search.

    Args:
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
    return refit.summary.is_material_step(before.summary, settings.min_closed, search.null.summary)


def is_material(search: Search, refit: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether each cause of a set is material beside the others."""
    sets = [candidate.summary for candidate in (*search.refits, refit)]
    material = select_material_sets(search.null.summary, sets, settings)
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
        chosen: the sets.
        refits: all sets.
    """
    evidence = Evidence(
        small_faults=search.small_faults,
        null=search.null.summary,
        sets=tuple(refit.summary for refit in refits),
        hypotheses=search.hypotheses,
        variance=find_variance_source(search.null.session.campaign),
    )
    sets = [refit.summary for refit in chosen]
    return compute_log_odds(evidence, sets, load_calibration()).tolist()


def find_confounded(
    scene: Scene, search: Search, posterior: Posterior, settings: DiagnosisSettings
) -> tuple[tuple[str, str], ...]:
    """Return pairs of causes whose signatures have a large cosine, or that are equally probable.

    Args:
        search: score tests about the null model.
        posterior: probabilities of the causes.
    """
    listed = {key: place for place, (key, _) in enumerate(posterior.apart)}
    leading = {
        score.hypothesis.key: score
        for score in reversed(search.scores)
        if score.hypothesis.key in listed and score.step.any()
    }
    pairs = [frozenset(map("@".join, pair)) for pair in posterior.find_confounded_pairs(settings)]
    scored = list(leading.values())
    if len(scored) > 1:
        null = search.null
        cosines = compute_cosines(scene, null.fit, scored, null.floor, settings.score_stride)
        pairs += [
            frozenset((first.hypothesis.site, second.hypothesis.site))
            for i, first in enumerate(scored)
            for j, second in enumerate(scored[:i])
            if abs(cosines[i, j]) >= settings.min_twin_cosine
        ]
    order = {f"{key[0]}@{key[1]}": place for key, place in listed.items()}
    ordered = [
        sorted(pair, key=lambda site: order.get(site, len(order))) for pair in dict.fromkeys(pairs)
    ]
    return tuple((pair[0], pair[1]) for pair in ordered if len(pair) == 2)


def find_interchangeable(
    search: Search, stride_factor: int, settings: DiagnosisSettings
) -> tuple[tuple[Site, Site], ...]:
    """Return pairs of places of one effect whose refits take the same off the gap.

    Both are fitted beside the same further causes; ``inference.places`` has the cosine.

    Args:
        stride_factor: factor on the strides of frequency lines.
        settings: schedule, and the least cosine.
    """
    stride = max(1, settings.schedule.stride // 2) * stride_factor

    @cache
    def residual(refit: Refit) -> tuple[Complex, ...]:
        thin = thin_lines(refit.session.campaign, stride)
        predicted = predict(refit.session.model, refit.fit.theta, thin)
        return tuple(
            model - test.estimate.frf.values
            for model, test in zip(predicted, thin.tests, strict=True)
        )

    fits: dict[frozenset[Site], Refit] = {}
    for refit in sorted(search.refits, key=lambda refit: refit.objective):
        fits.setdefault(_list_sites(refit.keys), refit)
    pairs: dict[tuple[Site, Site], None] = {}
    for (sites, first), (rivals, second) in combinations(fits.items(), 2):
        pair = tuple(sorted(sites ^ rivals))
        effects = {effect for effect, _ in pair}
        if len(sites) != len(rivals) or len(pair) != 2 or len(effects) > 1 or pair in pairs:
            continue
        without = residual(fits.get(sites & rivals, search.null))
        weights = _weigh(first, stride, min(first.floor, second.floor))
        cosine = compute_cosine(without, residual(first), residual(second), weights)
        if cosine >= settings.min_place_cosine:
            pairs[pair[0], pair[1]] = None
    return tuple(pairs)


def _list_sites(keys: Sequence[Key]) -> frozenset[Site]:
    """Return effect and location of each cause."""
    return frozenset(map(read_site, keys))


def _weigh(refit: Refit, stride: int, floor: float) -> list[Real]:
    """Return 1 / sigma of each value, zero where it does not count; (n_freq, n_out, 1) each."""
    weights = []
    for test in thin_lines(refit.session.campaign, stride).tests:
        counts, power = find_counted_values(test.estimate)
        variance = np.where(counts, test.estimate.variance + floor**2 * power, 1.0)
        weights.append(np.where(counts, 1 / np.sqrt(variance), 0.0))
    return weights


def compute_cosine(
    without: Sequence[Complex],
    first: Sequence[Complex],
    second: Sequence[Complex],
    weights: Sequence[Real],
) -> float:
    """Return the cosine between what two refits take off the residual of another.

    Args:
        without: residual of each test without the effect; (n_freq, n_out, 1) each.
        first: residual with it at one place.
        second: residual with it at another place.
        weights: 1 / sigma of each value.
    """
    explained = [
        np.concatenate(
            [
                (weight * (before - after)).ravel()
                for weight, before, after in zip(weights, without, residual, strict=True)
            ]
        )
        for residual in (first, second)
    ]
    size = np.linalg.norm(explained[0]) * np.linalg.norm(explained[1])
    return float(np.vdot(*explained).real / max(float(size), np.finfo(float).tiny))
