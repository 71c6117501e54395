"""The search for what explains a gap: scores of all, refits of the most promising."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from diagnosis.evidence import Key, Scored
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.refit import FIRST, LAST, LONG, PATIENT, Refit, go_on, refit, settled
from diagnosis.score import ALLOWANCE, Score, scores
from tuning import Fit

REFITTED = 6  # of the most promising, so many are fitted, as many again if none explains
_VARIANTS = 4  # of each effect, place and direction, so many shapes are scored again
_PROMISING = 0.03  # of the best score, what is worth a refit
_LEADING = 0.5  # of the best refit's gain, what goes on to the weights of the noise
_ROUNDS = 3  # of further steps
_LITTLE = 0.1  # of the gap: who leaves less explains it


@dataclass(frozen=True, eq=False)
class Search:
    """What was tried.

    Args:
        scores: of all hypotheses at the first refit's allowance, the most promising first.
        rows: gains of each effect and place at every allowance.
        begun: first refits, with some allowance, of the most promising.
        refits: at the weights of the noise, of those of them that lead; the best first.
    """

    scores: tuple[Score, ...] = ()
    rows: tuple[Scored, ...] = ()
    begun: tuple[Refit, ...] = ()
    refits: tuple[Refit, ...] = ()


def search(
    scene: Scene,
    without: tuple[Fit, Refit, Refit],
    asked: Sequence[Hypothesis],
    say: Callable[[str], None],
) -> Search:
    """Score all hypotheses, refit the most promising.

    Scores count with three allowances, each about a fit made with it: 3 % tells best, the noise
    alone tells weak effects, 10 % very strong ones.

    Args:
        scene: campaign and drawn model.
        without: fits without any effect at 10 %, 3 % and none.
        asked: hypotheses.
        say: told what is being done.
    """
    early, first, nothing = without
    say("scores of all hypotheses")
    scored = scores(scene, first.fit, asked, FIRST[-1].allowance)
    finer = [
        scores(scene, one, _variants(scored), allowance)
        for one, allowance in ((nothing.fit, PATIENT[-1].allowance), (early, ALLOWANCE))
    ]
    promising = _promising([scored, *finer])
    begun: list[Refit] = []
    ended: dict[tuple[str, ...], Refit] = {}
    refits: list[Refit] = []
    for turn in (promising[:REFITTED], promising[REFITTED:]):
        for one in turn:
            say(f"refit: {one.words}")
            begun.append(refit(scene, one, scene.session.campaign, FIRST))
        for made in _leading(first, begun):
            if made.hypothesis is not None and made.hypothesis.coordinates not in ended:
                ended[made.hypothesis.coordinates] = go_on(scene, made, LAST)
        refits = _patient(scene, list(ended.values()))
        ended = {one.hypothesis.coordinates: one for one in refits if one.hypothesis}
        if refits and refits[0].chi_square - 1 < _LITTLE * (nothing.chi_square - 1):
            break
    refits[:1] = [settled(scene, one) for one in refits[:1]]
    return Search(tuple(scored), _rows([scored, *finer]), tuple(begun), tuple(refits))


def _patient(scene: Scene, refits: Sequence[Refit]) -> list[Refit]:
    """The best first, and the two best at their minima: strong effects are many steps away."""
    found = sorted(refits, key=lambda one: one.cost)
    for _ in range(_ROUNDS):
        away = [k for k, one in enumerate(found[:2]) if not one.fit.converged]
        if not away:
            break
        for k in away:
            found[k] = go_on(scene, found[k], LONG)
        found.sort(key=lambda one: one.cost)
    return found


def _variants(scored: Sequence[Score]) -> list[Hypothesis]:
    """Of each effect, place and direction the shapes with the highest scores."""
    found: dict[Key, list[Hypothesis]] = {}
    for score in scored:
        own = found.setdefault(score.hypothesis.key, [])
        if len(own) < _VARIANTS:
            own.append(score.hypothesis)
    return [one for own in found.values() for one in own]


def _best(scored: Sequence[Score]) -> dict[tuple[str, str], Score]:
    """The best score of each effect and place, the most promising first."""
    found: dict[tuple[str, str], Score] = {}
    for score in scored:
        found.setdefault((score.hypothesis.effect, score.hypothesis.location), score)
    return found


def _rows(rounds: Sequence[Sequence[Score]]) -> tuple[Scored, ...]:
    """Gains of each effect and place at every allowance."""
    found = [_best(scored) for scored in rounds]
    return tuple(
        Scored(
            effect=effect,
            location=location,
            dof=score.hypothesis.dof,
            gains=tuple(one[effect, location].gain for one in found),
        )
        for (effect, location), score in found[0].items()
    )


def _promising(rounds: Sequence[Sequence[Score]]) -> list[Hypothesis]:
    """The best of each effect and place, taken in turn from the rounds of scores."""
    orders = [
        [score for score in _best(scored).values() if score.gain > _PROMISING * scored[0].gain]
        for scored in rounds
    ]
    found: dict[tuple[str, str], Hypothesis] = {}
    for place in range(2 * REFITTED):
        for order in orders:
            if place < len(order) and len(found) < 2 * REFITTED:
                one = order[place].hypothesis
                found.setdefault((one.effect, one.location), one)
    return list(found.values())


def _leading(nothing: Refit, refits: Sequence[Refit]) -> list[Refit]:
    """Those that, with some allowance still, gain nearly as much as the best."""
    gains = [nothing.cost - one.cost for one in refits]
    least = _LEADING * max(gains, default=0.0)
    order = sorted(range(len(refits)), key=lambda k: -gains[k])
    return [refits[k] for k in order if gains[k] >= least]
