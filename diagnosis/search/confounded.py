"""Confounded causes: pairs with equal signatures or equal probabilities."""

from diagnosis.hypothesis import Scene
from diagnosis.inference.posterior import Posterior
from diagnosis.search.fitted_sets import Search
from diagnosis.search.score_test import compute_cosines
from diagnosis.settings import DiagnosisSettings


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
    listed = {key: place for place, (key, _) in enumerate(posterior.causes)}
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
