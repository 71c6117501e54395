"""The search for what explains a gap: scores of all, refits of the most promising."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import calibrated
from diagnosis.inference.evidence import Key, Pushed, Scored
from diagnosis.inference.posterior import compared
from diagnosis.refits.parallel import Call, side_by_side
from diagnosis.refits.refitting import (
    CLOSE,
    FIRST,
    FROM_AFAR,
    LAST,
    LONG,
    PATIENT,
    Refit,
    fitted,
    further,
    go_on,
    refit,
    unbounded,
)
from diagnosis.search.free_force import pushes
from diagnosis.search.score_test import ALLOWANCE, Score, gains, lines_over, ranked
from diagnosis.search.screening import REFITTED, Direction, Screening, best_of
from tuning import Fit

_THERE = 9  # of effects where free forces explain most, so many are fitted beside
_CLOSEST = 2  # of the best scores at the weights of the noise, wherever: allowances hide small gaps
_PLACES = 2  # where free forces explain most, whose effects are tried
_VARIANTS = 4  # of each effect, place and direction, so many shapes are scored again
_NEAR = 0.2, 0.05, 0.05  # of the best gain, in rounds of further steps: who is no farther goes on
_WANDERS = 0.8  # of what was left before many steps: who leaves more will not arrive
_ALMOST = 0.8  # of what a free force explains at most: where it does, effects may begin elsewhere
_HARDLY = 0.2  # of the gap: who leaves less may leave it to tolerances beyond their bounds
_OUTLIERS = 0.3  # of the variance: as much as these leave anyway
_SCORED = 0.2  # of the best score: where what explains all is tried too
_MORE_PLACES = 3  # at so many places
_RIVALS = 0.5  # of what the best gains: who scores as much at the weights of the noise is tried
_SURE = 10.0  # nats: of a free force that is there, or an effect
_EXACT = 0.01  # of the variance, that a refit may leave by chance
_CLEAR = 0.02  # of the gap: who leaves less explains it
_LITTLE = 0.1  # beyond, more are tried
# Of the gap, as the judgement has it, what may be left after each turn: the most promising; where
# forces push; there from afar; from all that is far there, which takes long; all that is left.
_ENOUGH = _CLEAR, _CLEAR, _LITTLE, _LITTLE, 1.0


@dataclass(frozen=True, eq=False)
class Search:
    """What was tried.

    Args:
        scores: of all hypotheses at the first refit's allowance, the most promising first.
        rows: gains of each effect and place at every allowance.
        pushed: what free forces explain at each place.
        begun: first refits, with some allowance, of the most promising.
        refits: at the weights of the noise, of those of them that lead; the best first.
        pairs: likewise, with two effects at once.
    """

    scores: tuple[Score, ...] = ()
    rows: tuple[Scored, ...] = ()
    pushed: tuple[Pushed, ...] = ()
    begun: tuple[Refit, ...] = ()
    refits: tuple[Refit, ...] = ()
    pairs: tuple[Refit, ...] = ()


class Hunt:
    """The search for one effect, turn by turn.

    Scores count with three allowances, each about a fit made with it: 3 % tells best, the noise
    alone tells weak effects, 10 % very strong ones. Where a free force explains most, effects are
    tried whatever their scores.

    Args:
        scene: campaign and drawn model.
        without: fits without any effect at 10 %, 3 % and none.
        proposed: hypotheses.
        say: told what is being done.
    """

    def __init__(
        self,
        scene: Scene,
        without: tuple[Fit, Refit, Refit],
        proposed: Sequence[Hypothesis],
        say: Callable[[str], None],
    ) -> None:
        early, first, nothing = without
        say("scores of all hypotheses, free forces at every place")
        calls: list[Call] = [
            (gains, (scene, first.fit, proposed, FIRST[-1].model_error_floor)),
            (pushes, (scene, nothing.fit)),
        ]
        gained, self._pushed = side_by_side(calls, scene.jobs)
        scored = ranked(proposed, gained)
        forced = [(one.location, one.dof) for one in self._pushed[:_PLACES] if one.gain > _SURE]
        places = [place for place, _ in forced]
        some = _variants(scored)
        there = [one for one in proposed if one.location in places and one not in some]
        say("scores of the best with other allowances")
        near = [*some, *there]
        calls = [
            (gains, (scene, nothing.fit, near, PATIENT[-1].model_error_floor)),
            (gains, (scene, early, some, ALLOWANCE)),
        ]
        near_gained, some_gained = side_by_side(calls, scene.jobs)
        self._rounds = [scored, ranked(near, near_gained), ranked(some, some_gained)]
        self._far = Screening(scene, first, FIRST, self._rounds, say)
        self._close = Screening(scene, nothing, CLOSE, [self._rounds[1]], say)
        self._scene, self._nothing, self._forced, self._say = scene, nothing, forced, say
        self._promising = self._far.best()
        self._elsewhere: list[list[Hypothesis]] = []
        self._ended: dict[Hypothesis | None, Refit] = {}
        self._wander: set[Hypothesis | None] = set()
        self._best: list[Refit] = []
        self._turn = 0
        self.enough = False

    def go(self, until: int = len(_ENOUGH)) -> Search:
        """Take turns, in each of which more is tried, until enough is explained.

        Args:
            until: the number of turns, all in all.

        Returns:
            What was tried so far.
        """
        scene, gap = self._scene, max(self._nothing.gap, 0.0)
        while not self.enough and self._turn < until:
            self._try_more(self._turn)
            self._go_further()
            least = _ENOUGH[self._turn] * compared(gap) + _EXACT
            self.enough = self._is_hopeless() or self._leaves_less(least)
            self._turn += 1
            if self.enough and self._best:
                self._try_other_places(self._best[0])
                self._try_rivals(self._best[0])
        if self._best:
            self._best[0] = self._unbound(go_on(scene, self._best[0], LONG))
            self._ended[self._best[0].hypothesis] = self._best[0]
        return Search(
            tuple(self._rounds[0]),
            _rows(self._rounds),
            self._pushed,
            (*self._far.begun, *self._close.begun),
            tuple(self._best),
        )

    def _is_hopeless(self) -> bool:
        """Whether nothing promises to explain anything.

        Where no free force does, which has as many values as the lines, an effect of a few may: the
        best scores at the weights of the noise are tried, and that is all.
        """
        if self._forced:
            return False
        promised = max((score.gain for score in self._rounds[1]), default=0.0)
        return self._turn > 0 or promised < _SURE

    def _go_further(self) -> None:
        """Steps of what leads, the best first then."""
        self._say("further steps of what leads")
        leading = {
            made.hypothesis: made for made in (*self._close.levelled(), *self._far.levelled())
        }
        tasks = [further(made, LAST) for one, made in leading.items() if one not in self._ended]
        self._ended |= {made.hypothesis: made for made in fitted(self._scene, tasks)}
        self._best = self._patient(_one_each(list(self._ended.values())))

    def _try_other_places(self, best: Refit) -> None:
        """The effect that explains all, at other places where its score comes near.

        Bodies that move alike, such as two granites, carry a link or a mass alike: who was asked
        first is not the only one.
        """
        if best.hypothesis is None:
            return
        tried = {made.key[:2] for made in (*self._far.begun, *self._close.begun) if made.key}
        near = [
            (score.gain / scored[0].gain, score.hypothesis)
            for scored in self._rounds
            for score in best_of(scored).values()
            if score.gain > _SCORED * scored[0].gain > 0
        ]
        found: dict[str, Hypothesis] = {}
        for _, one in sorted(near, key=lambda row: -row[0]):
            if one.effect == best.hypothesis.effect and one.key[:2] not in tried:
                found.setdefault(one.location, one)
        if found:
            self._far.try_all(list(found.values())[:_MORE_PLACES])
            self._go_further()

    def _try_rivals(self, best: Refit) -> None:
        """Who scores near what the best gains, at the weights of the noise.

        First steps with an allowance hide who explains a small gap: of what is left of a support
        that lost a thousandth of its stiffness a mass took all, and nobody asked for the support.
        """
        least = _RIVALS * (self._nothing.cost - best.cost)
        known = {made.key[:2] for made in (*self._ended.values(), *self._close.begun) if made.key}
        lines = len(self._scene.session.campaign.freq_hz)
        times = lines_over(lines, self._scene.pace)
        near = [
            score.hypothesis
            for site, score in best_of(self._rounds[1]).items()
            if times * score.gain > least > 0 and site not in known
        ]
        if near:
            self._begin_close()
            self._close.try_all(near[:_CLOSEST])
            self._go_further()

    def _begin_close(self) -> None:
        """Who is tried at the weights of the noise is compared with as many steps of nothing."""
        if self._close.nothing is self._nothing:
            scene = self._scene
            self._close.nothing = refit(scene, None, scene.session.campaign, CLOSE)

    def _leaves_less(self, least: float) -> bool:
        """Whether the best does, with tolerances beyond their bounds as far as an outlier may."""
        if not self._best:
            return False
        return self._unbound(self._best[0], least).left(calibrated().outlier) < least

    def _unbound(self, best: Refit, least: float = _EXACT) -> Refit:
        """The same, with what it leaves without bounds, where these may leave so much of it."""
        if best.gap < least or best.gap > max(_HARDLY * self._nothing.gap, _OUTLIERS):
            return best
        return unbounded(self._scene, best)

    def _try_more(self, turn: int) -> None:
        close, far = self._close, self._far
        first = 2 if self._scene.there else 1  # of the beginnings of each
        if turn == 1:
            self._begin_close()
            there = [*close.best(self._forced)[:_THERE], *close.best()[:_CLOSEST]]
            close.try_all(list({one.key: one for one in there}.values()))
            self._elsewhere = self._from(self._forced)
        elif turn == 2:
            close.try_all([one for own in self._elsewhere for one in own[:first]], FROM_AFAR)
        elif turn == 3:
            close.try_all([one for own in self._elsewhere for one in own[first:]], FROM_AFAR)
        elif turn:
            far.try_all(self._promising[REFITTED:])
            others = self._from(nearly(self._pushed, self._forced))
            close.try_all([one for own in others for one in own], FROM_AFAR)
        else:
            far.try_all(self._promising[:REFITTED])
        if turn:
            far.try_other_directions()

    def _from(self, pushing: Sequence[Direction]) -> list[list[Hypothesis]]:
        return _elsewhere(self._rounds[:2], pushing, self._scene)

    def _patient(self, refits: Sequence[Refit]) -> list[Refit]:
        """The best first, at its minimum, and the second if it may still come near.

        Strong effects are many steps away; but a wrong hypothesis wanders for as many, and gains
        little by it.
        """
        found = sorted(refits, key=lambda one: one.cost)
        for near in _NEAR:
            least = found[0].cost + near * (self._nothing.cost - found[0].cost) if found else 0.0
            away = [
                k
                for k, one in enumerate(found[:2])
                if not one.fit.converged
                and one.hypothesis not in self._wander
                and one.cost <= least
            ]
            tasks = [further(found[k], LONG) for k in away]
            for k, made in zip(away, fitted(self._scene, tasks), strict=True):
                if made.gap > _WANDERS * found[k].gap:
                    self._wander.add(made.hypothesis)
                found[k] = made
            found.sort(key=lambda one: one.cost)
            if not away:
                break
        self._ended |= {one.hypothesis: one for one in found}
        return found


def beginnings(one: Hypothesis, scene: Scene) -> list[Hypothesis]:
    """The same, begun elsewhere, and all else as drawn.

    A fit without a strong effect has made springs a hundred times as stiff; but with one that is
    there already it need not have: then each begins from that fit too, before.
    """
    varies = set(scene.session.parametrisation.names) - scene.there
    names = zip(scene.model.parameters, scene.model.drawn.tolist(), strict=True)
    drawn = {one.name: value for one, value in names if one.name in varies}
    fits = ({}, drawn) if scene.there else (drawn,)
    return [replace(one, begin={**fit, **other}) for other in one.otherwise for fit in fits]


def nearly(pushed: Sequence[Pushed], tried: Sequence[Direction]) -> list[Direction]:
    """Where a force explains nearly as much as anywhere: of low modes on all stages.

    Args:
        pushed: what free forces explain, the most first.
        tried: places that are not asked for.
    """
    places = {place for place, _ in tried}
    least = _ALMOST * max((one.gain for one in pushed), default=0.0)
    others = [one for one in pushed if one.location not in places]
    return [(one.location, one.dof) for one in others if one.gain > least > 0]


def _elsewhere(
    rounds: Sequence[Sequence[Score]], pushing: Sequence[Direction], scene: Scene
) -> list[list[Hypothesis]]:
    """Where forces push most, what may begin elsewhere, from there; of each all its beginnings.

    What concerns one direction does so if a round of scores sees nothing in it.
    """
    places = {place for place, _ in pushing}
    best = [_best_of_keys(scored) for scored in rounds]
    found = []
    for key, score in {**best[-1], **best[0]}.items():
        one = score.hypothesis
        there = one.location in places if one.dof is None else (one.location, one.dof) in pushing
        blind = any(key in own and own[key].gain <= 0 for own in best)
        if there and one.otherwise and (one.dof is None or blind):
            found.append(beginnings(one, scene))
    return found


def _best_of_keys(scored: Sequence[Score]) -> dict[Key, Score]:
    """The best score of each effect, place and direction, the most promising first."""
    found: dict[Key, Score] = {}
    for score in scored:
        found.setdefault(score.hypothesis.key, score)
    return found


def _one_each(refits: Sequence[Refit]) -> list[Refit]:
    """The best shape of each effect, place and direction."""
    found: dict[Key, Refit] = {}
    for made in sorted(refits, key=lambda one: one.cost):
        if made.hypothesis is not None:
            found.setdefault(made.hypothesis.key, made)
    return list(found.values())


def _variants(scored: Sequence[Score]) -> list[Hypothesis]:
    """Of each effect, place and direction the shapes with the highest scores."""
    found: dict[Key, list[Hypothesis]] = {}
    for score in scored:
        own = found.setdefault(score.hypothesis.key, [])
        if len(own) < _VARIANTS:
            own.append(score.hypothesis)
    return [one for own in found.values() for one in own]


def _rows(rounds: Sequence[Sequence[Score]]) -> tuple[Scored, ...]:
    """Gains of each effect and place at every allowance."""
    found = [best_of(scored) for scored in rounds]
    return tuple(
        Scored(
            effect=effect,
            location=location,
            dof=score.hypothesis.dof,
            gains=tuple(one[effect, location].gain for one in found),
        )
        for (effect, location), score in found[0].items()
    )
