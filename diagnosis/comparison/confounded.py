"""Confounded causes: pairs whose signatures or held-out scores cannot be told apart."""

from diagnosis.hypothesis import Scene
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import NATS, Posterior
from diagnosis.refits.refitting import FIRST
from diagnosis.search.ladder import Search
from diagnosis.search.score_test import cosines
from tuning import Fit

_ALIKE = 0.9  # cosine of signatures: twins


def find_confounded(
    scene: Scene, found: Fit, evidence: Evidence, judged: Posterior, tried: Search
) -> tuple[tuple[str, str], ...]:
    """Pairs of causes whose signatures have a cosine of 0.9, or that foretell as well.

    They do where what they leave of what no fit saw differs by less than 3 nats, of as much as is
    enough for fits, as it is or by what decides anything, which are more.
    """
    costs = {one.hypothesis.identity: one.cost for one in tried.refits if one.hypothesis}
    told = {one.key: one.foretold for one in evidence.refits}
    named = {key for key, _ in judged.causes}
    leading = [
        one
        for one in tried.scores
        if one.hypothesis.key in named and one.hypothesis.identity in costs and one.step.any()
    ]
    pairs = [frozenset(map("@".join, pair)) for pair in judged.twins]
    alike = (
        cosines(scene, found, leading, FIRST[-1].model_error_floor) if len(leading) > 1 else None
    )
    for i, one in enumerate(leading):
        for j, other in enumerate(leading[:i]):
            cost, less = (told.get(x.hypothesis.key) for x in (one, other))
            if cost is None or less is None:
                cost, less = (costs[x.hypothesis.identity] for x in (one, other))
            near = abs(cost - less) < NATS or (alike is not None and abs(alike[i, j]) >= _ALIKE)
            if near:
                pairs.append(frozenset((other.hypothesis.site, one.hypothesis.site)))
    order = {f"{key[0]}@{key[1]}": place for place, (key, _) in enumerate(judged.causes)}
    sites = [sorted(pair, key=lambda one: order[one]) for pair in dict.fromkeys(pairs)]
    return tuple((both[0], both[1]) for both in sites if len(both) == 2)
