"""Evidence and posterior of all that was tried, rivals compared by their held-out scores."""

from collections.abc import Callable

from diagnosis.comparison.predictive import at_ease, foretold, rivals_of
from diagnosis.hypothesis import Scene
from diagnosis.inference.calibration import calibrated
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import Posterior, judge
from diagnosis.search.ladder import Search


def judge_rivals(
    scene: Scene, found: Search, read: Callable[[Search], Evidence], say: Callable[[str], None]
) -> tuple[Search, Evidence, Posterior]:
    """What was tried, evidence, judgement; of rivals with what they foretell of unseen data.

    Args:
        scene: of the search.
        found: what was tried.
        read: the evidence of that.
        say: told what is being done.
    """
    evidence = read(found)
    eased = at_ease(scene, found, judge(evidence), calibrated().outlier)
    if eased is not found:
        found, evidence = eased, read(eased)
    judged = judge(evidence)
    rivals = rivals_of(judged, found)
    if len(rivals) < 2:
        return found, evidence, judged
    say("what rivals foretell of what their fits did not see")
    scores = foretold(scene, [one for _, one, _ in rivals])
    told = dict(zip((keys for keys, _, _ in rivals), scores, strict=True))
    update: dict[str, object] = {
        "refits": tuple(
            one.model_copy(update={"foretold": told.get((one.key,))}) for one in evidence.refits
        ),
        "pairs": tuple(
            one.model_copy(update={"foretold": told.get(one.keys)}) for one in evidence.pairs
        ),
    }
    evidence = evidence.model_copy(update=update)
    return found, evidence, judge(evidence)
