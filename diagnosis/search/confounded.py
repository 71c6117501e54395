"""Confounded causes: equal signatures, equal probabilities, or one effect at several places."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.inference.evidence import Key, Site, read_site
from diagnosis.inference.posterior import Posterior
from diagnosis.refits.refit import Refit
from diagnosis.search.fitted_sets import Search
from diagnosis.search.score_test import compute_cosines
from diagnosis.settings import DiagnosisSettings
from identification.words import Complex, Real
from tuning import predict, thin_lines
from tuning.misfit.model_error import find_counted_values


def find_confounded(
    scene: Scene, search: Search, posterior: Posterior, settings: DiagnosisSettings
) -> tuple[tuple[str, str], ...]:
    """Return pairs of causes whose signatures have a large cosine, or that are equally probable.

    Args:
        scene: campaign, model and theta of the null model.
        search: score tests about the null model.
        posterior: probabilities of the causes.
        settings: thresholds.
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
        search: sets of causes that were fitted.
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
