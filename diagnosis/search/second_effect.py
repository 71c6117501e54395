"""A second effect beside the first: forward selection, with a backward check.

What the best single effect leaves is a gap like any other: with that effect in the model all
hypotheses are scored again, the most promising refitted, both then fitted at once. If one of the
two alone leaves as little, the other was not needed: so the second is fitted alone too. A wrong
first may have taken the part of both: so others that led with it are fitted in its place, always
those that alone explain nearly as much; and where no pair explains all, whatever explains most
beside the second. And the first may not have arrived: so it is begun elsewhere before, and each is
fitted alone once more, from where both ended.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.effects import catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.hypothesis_set import together
from diagnosis.inference.calibration import calibrated
from diagnosis.inference.evidence import Key
from diagnosis.refits.refitting import (
    FIRST,
    FROM_AFAR,
    LONG,
    ONWARD,
    Refit,
    RefitTask,
    asked,
    begun_at,
    fitted,
    further,
    go_on,
    refit,
    unbounded,
)
from diagnosis.search.ladder import Hunt, Search, beginnings
from tuning import STAGES, Fit

_EARLY = (replace(STAGES[2], stride=8, max_steps=5),)
_PARTNERS = 2  # of the first, so many are stated
_OTHERS = 2  # in its place, so many are fitted beside the second
_TIED = 0.1  # of its gain: who alone gains less by no more is tried there even beside a good pair
_FOREIGN = 0.15  # of the variance, that no pair leaves both of which are there
_MOST = 0.5  # of what the first leaves
TURNS = 3  # of the search for one, before two are asked for
BESIDE = 2  # of that for another beside it; where nobody takes much, as many as for one
_FAR = 2.0  # times what the first leaves: who leaves more from elsewhere will not do better
_SAME = 0.98  # of the cost: what was known of the first before
_WORTH = 0.75  # of the gap, what the first may leave at most
_LEFT = 0.4  # of that, what a pair may leave that is worth a check


def searched(
    scene: Scene,
    without: tuple[Fit, Refit, Refit],
    proposed: Sequence[Hypothesis],
    say: Callable[[str], None],
) -> Search:
    """Search for one effect and, where it leaves much, for a second beside it.

    Two at once are asked for before all that is left of one, which takes long: of two each is found
    from near. Pairs that leave more than noise wait until all of one was tried.

    Args:
        scene: campaign and drawn model.
        without: fits without any effect at 10 %, 3 % and none.
        proposed: hypotheses.
        say: told what is being done.
    """
    nothing = without[-1]
    hunt = Hunt(scene, without, proposed, say)
    found = with_second(scene, nothing, hunt.go(TURNS), proposed, say)
    if hunt.enough or any(made.gap < made.exact for made in (*found.refits, *found.pairs)):
        return found
    more = hunt.go()
    first, before = (next(iter(tried.refits), None) for tried in (more, found))
    if (
        first is None
        or before is None
        or first.coordinates != before.coordinates
        or first.cost < _SAME * before.cost
    ):
        return with_second(scene, nothing, more, proposed, say)
    single = {made.key: made for made in (*found.refits, *more.refits)} | {before.key: before}
    refits = sorted(single.values(), key=lambda made: made.cost)
    return replace(more, refits=tuple(refits), pairs=found.pairs)


def with_second(
    scene: Scene,
    nothing: Refit,
    found: Search,
    proposed: Sequence[Hypothesis],
    say: Callable[[str], None],
) -> Search:
    """What was found, with the pairs that its best effect is part of.

    Args:
        scene: campaign and drawn model.
        nothing: the fit without any effect, at the weights of the noise.
        found: the search for one effect.
        proposed: hypotheses of that.
        say: told what is being done.
    """
    if not found.refits or found.refits[0].hypothesis is None:
        return found
    first, one = found.refits[0], found.refits[0].hypothesis
    if not first.exact < first.gap < _WORTH * nothing.gap:
        return found
    first = first if first.loose is not None else unbounded(scene, first)
    if not _is_outlier(first):
        first = _from_elsewhere(scene, first, one)
    found = replace(found, refits=(first, *found.refits[1:]))
    if first.gap < first.exact or _is_outlier(first):
        return found
    say("a second effect")
    beside = _beside(scene, first, proposed, say)
    pairs = [_pair(one, both) for both in beside]
    if not pairs:
        return found
    best = min(pairs, key=lambda both: both.cost)
    if not _takes_much(best, first):
        return replace(found, pairs=ordered(scene, pairs))
    second = beside[0]
    known = next((made for made in found.refits if made.key == second.key), None)
    lone = by_itself(scene, second, proposed) if known is None else further(known, LONG)
    longer = further(first, LONG), replace(lone, stages=LONG)
    tasks = [begun_at(task, best) for task in longer]
    if known is None:
        tasks.append(lone)
    again, *made = fitted(scene, tasks)
    alone = min((*made, *([] if known is None else [known])), key=lambda made: made.cost)
    if again.cost < first.cost:
        found = replace(found, refits=(unbounded(scene, again), *found.refits[1:]))
    tied = first.cost + _TIED * (nothing.cost - first.cost)
    least = np.inf if best.gap > best.exact else tied
    pairs += _exchanged(scene, [made for made in found.refits[1:] if made.cost < least], alone)
    other = alone.hypothesis
    if other is not None and min(both.gap for both in pairs) > _FOREIGN:
        say("another in the place of the first")
        instead = _beside(scene, alone, proposed, say)
        pairs += [_pair(other, both) for both in instead]
    single = {made.key: made for made in (*found.refits, alone)}
    return replace(
        found,
        refits=tuple(sorted(single.values(), key=lambda made: made.cost)),
        pairs=ordered(scene, pairs),
    )


def _beside(
    scene: Scene, first: Refit, proposed: Sequence[Hypothesis], say: Callable[[str], None]
) -> list[Refit]:
    """What leaves less than the first alone, beside it; from afar too where nobody takes much."""
    one = first.hypothesis
    if one is None:
        raise ValueError("there is no first")
    inner = replace(scene, session=first.session, theta=first.fit.theta, there=one.names)
    early = refit(inner, None, inner.session.campaign, _EARLY)
    close = go_on(inner, early, FIRST)
    elsewhere = (other for other in proposed if other.location != one.location)
    allowed = {(other.effect, other.location) for other in elsewhere}
    possible = (other for effect in catalogue().values() for other in effect(inner))
    others = [other for other in possible if (other.effect, other.location) in allowed]
    left = replace(first, hypothesis=None)
    hunt = Hunt(inner, (early.fit, close, left), others, say)
    found: list[Refit] = []
    for turns in (BESIDE, TURNS):
        refits = hunt.go(turns).refits[:_PARTNERS]
        found = [both for both in refits if both.cost < first.cost]
        if any(_takes_much(both, first) for both in found):
            break
    return found


def _takes_much(both: Refit, first: Refit) -> bool:
    """Whether little is left of what the first leaves."""
    return both.gap <= _LEFT * first.gap


def _from_elsewhere(scene: Scene, first: Refit, one: Hypothesis) -> Refit:
    """The first, if it may begin far from nothing, from there, where that ends better."""
    campaign, others = scene.session.campaign, beginnings(one, scene)
    begun = fitted(scene, [asked(scene, other, campaign, FROM_AFAR) for other in others])
    best = min(begun, key=lambda made: made.cost, default=None)
    if best is None or best.gap > _FAR * first.gap:
        return first
    again = go_on(scene, best, LONG)
    return unbounded(scene, again) if again.cost < first.cost else first


def _pair(one: Hypothesis, both: Refit) -> Refit:
    """A refit about one hypothesis as that of two."""
    if both.hypothesis is None:
        raise ValueError("nothing was fitted beside the first")
    return replace(both, hypothesis=together((one, both.hypothesis)))


def ordered(scene: Scene, pairs: Sequence[Refit]) -> tuple[Refit, ...]:
    """The best first, with what it leaves if tolerances have no bounds, where it leaves much.

    Of the same two, whichever was there first, the better fit.
    """
    single: dict[frozenset[Key], Refit] = {}
    for both in sorted(pairs, key=lambda both: both.cost):
        members = both.hypothesis.members if both.hypothesis else ()
        single.setdefault(frozenset(one.key for one in members), both)
    best, *others = single.values()
    return (unbounded(scene, best) if best.gap > best.exact else best, *others)


def by_itself(scene: Scene, second: Refit, proposed: Sequence[Hypothesis]) -> RefitTask:
    """The second effect without the first; beside it shapes may have been others."""
    known = None if second.hypothesis is None else second.hypothesis.identity
    same = (one for one in proposed if one.identity == known)
    one = next(same, second.hypothesis)
    return asked(scene, one, scene.session.campaign, (*FIRST, *ONWARD))


def _exchanged(scene: Scene, rivals: Sequence[Refit], second: Refit) -> list[Refit]:
    """The second with others in the place of the first, which alone took the part of both."""
    one = second.hypothesis
    if one is None:
        return []
    inner = replace(scene, session=second.session, theta=second.fit.theta)
    others = [made.hypothesis for made in rivals if made.hypothesis]
    chosen = [other for other in others if other.location != one.location][:_OTHERS]
    campaign = inner.session.campaign
    tasks = [asked(inner, other, campaign, (*FIRST, *ONWARD, *LONG)) for other in chosen]
    return [_pair(one, both) for both in fitted(inner, tasks)]


def _is_outlier(first: Refit) -> bool:
    """Whether tolerances beyond their bounds, none by much, are most of what is left."""
    if first.loose is None or first.pull is None:
        return False
    least = max(first.exact, _MOST * first.gap)
    return first.pull <= calibrated().outlier and first.loose - 1 < least
