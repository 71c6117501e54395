"""First refits with one allowance: who of many hypotheses is worth more."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import Key
from diagnosis.refits.refitting import LEVELLED, Refit, asked, fitted, further
from diagnosis.search.score_test import Score
from tuning import Stage

Direction = tuple[str, str | None]  # a place, and along or about which axis
REFITTED = 6  # of the most promising, so many are fitted, as many again if none explains
_OTHERS = 3  # of the best, so many other shapes are fitted
_PROMISING = 0.03  # of the best score, what is worth a refit
_LEADING = 0.5  # of the best refit's gain, what goes on by the logarithm
_AHEAD = 0.75  # of it then, what goes on to the weights of the noise
_SHAPES = 2  # of what leads, of each effect, place and direction


@dataclass
class Screening:
    """First refits with one allowance, which tell who is worth more.

    Args:
        scene: from where they start.
        nothing: the fit without any effect there.
        stages: of the refits.
        rounds: scores, that choose who is tried.
        say: told what is being done.
        begun: those that were made.
    """

    scene: Scene
    nothing: Refit
    stages: tuple[Stage, ...]
    rounds: Sequence[Sequence[Score]]
    say: Callable[[str], None]
    begun: list[Refit] = field(default_factory=list)
    _level: set[Hypothesis | None] = field(default_factory=set)

    def best(self, pushing: Sequence[Direction] = ()) -> list[Hypothesis]:
        """The best of each effect and place, taken in turn from the rounds of scores.

        Args:
            pushing: places, each with a direction; if given, effects are worth a try there
                whatever their scores, those of one direction in that one as well.
        """
        orders = []
        for scored in self.rounds:
            least = _PROMISING * scored[0].gain if scored and not pushing else 0.0
            orders.append([score for score in best_of(scored).values() if score.gain > least])
        if pushing:
            along = [best_of(_along(scored, pushing)) for scored in self.rounds]
            orders = [
                [score for score in order if score.hypothesis.location == place]
                for place, _ in pushing
                for order in (*orders, *(list(one.values()) for one in along))
            ]
        found: dict[Key, Hypothesis] = {}
        for number in range(2 * REFITTED):
            for order in orders:
                if number < len(order) and len(found) < 2 * REFITTED:
                    one = order[number].hypothesis
                    found.setdefault(one.key, one)
        return list(found.values())

    def try_all(
        self, several: Sequence[Hypothesis], stages: tuple[Stage, ...] | None = None
    ) -> None:
        """Refit several, then other shapes of the best, which may end elsewhere.

        Args:
            several: hypotheses.
            stages: that they go through, with the same end; the usual ones if None.
        """
        self._try(several, stages)
        best = min(self.begun, key=lambda made: made.cost, default=None)
        if best is None or best.hypothesis is None:
            return
        tried = {made.coordinates for made in self.begun}
        own = [s.hypothesis for s in self.rounds[0] if s.hypothesis.key == best.hypothesis.key]
        self._try([one for one in own if one.coordinates not in tried][:_OTHERS])

    def try_other_directions(self) -> None:
        """Refit what is best in the directions, or tests, that were not tried of it.

        About a fit without a strong effect another direction may score higher than its own.
        """
        best = min(self.begun, key=lambda made: made.cost, default=None)
        if best is None or best.hypothesis is None:
            return
        site = best.hypothesis.site
        tried = {made.key for made in self.begun}
        others: dict[Key, Hypothesis] = {}
        for score in (score for scored in self.rounds for score in scored):
            if score.hypothesis.site == site and score.hypothesis.key not in tried:
                others.setdefault(score.hypothesis.key, score.hypothesis)
        self._try(list(others.values()))

    def _try(self, several: Sequence[Hypothesis], stages: tuple[Stage, ...] | None = None) -> None:
        campaign = self.scene.session.campaign
        tasks = [asked(self.scene, one, campaign, stages or self.stages) for one in several]
        for made in fitted(self.scene, tasks):
            if made.hypothesis is not None:
                self.say(f"refitted: {made.hypothesis.words}")
            self.begun.append(made)

    def levelled(self) -> list[Refit]:
        """Those that lead when those that led have gone the way by the logarithm once more."""
        led = [made for made in self.leading(_LEADING) if made.hypothesis not in self._level]
        tasks = [further(made, (LEVELLED, *self.stages)) for made in led]
        again = {made.hypothesis: made for made in fitted(self.scene, tasks)}
        self._level |= again.keys()
        self.begun = [
            min(made, again.get(made.hypothesis, made), key=lambda one: one.cost)
            for made in self.begun
        ]
        return self.leading(_AHEAD)

    def leading(self, part: float) -> list[Refit]:
        """Those that gain at least so much of what the best does, of each key a few shapes."""
        gains = [self.nothing.cost - one.cost for one in self.begun]
        least = part * max(gains, default=0.0)
        order = sorted(range(len(gains)), key=lambda k: -gains[k])
        found: list[Refit] = []
        for made in (self.begun[k] for k in order if gains[k] >= least > 0):
            if sum(one.key == made.key for one in found) < _SHAPES:
                found.append(made)
        return found


def _along(scored: Sequence[Score], pushing: Sequence[Direction]) -> list[Score]:
    """Those of one direction, along which a force pushes there."""
    return [
        score
        for score in scored
        if (score.hypothesis.location, score.hypothesis.dof) in pushing and score.gain > 0
    ]


def best_of(scored: Sequence[Score]) -> dict[tuple[str, str], Score]:
    """The best score of each effect and place, the most promising first."""
    found: dict[tuple[str, str], Score] = {}
    for score in scored:
        found.setdefault((score.hypothesis.effect, score.hypothesis.location), score)
    return found
