r"""The smallest size of each effect at each place that a diagnosis of a test names, predicted.

The posterior (``inference.posterior``) weighs the fits that a diagnosis would make of a change of
the FRFs, in closed form (``linear_search``): the null model, the effect itself, and the rivals that
the score test about the null model ranks first. The size is halved in until the effect has half of
the probability. With the gap e_S per value, a fit at its own model-error floor has the mean cost

    c_S = 1 + ln(1 + e_S).

The gap of the null model is known to the error of all n values; nine of ten are above the gap less
1.28 / n^1/2, which counts. That size, sigma_0, is the one of a machine as drawn. Noise and
tolerances of the machine shift the size that a fit finds by a standard deviation of
1 / (d' Q d)^1/2, d being the effect of size one. So nine tests of ten find

    sigma_0 + 1.28 / (d' Q d)^1/2.

An effect with a direction or a scanned shape has that of nine in ten of its directions and shapes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TypeVar

import numpy as np
from scipy.special import ndtri

from diagnosis.data_checks.check_data import release_session
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.next_test.drawn_effects import DrawnEffects, SizedEffect, propose_linear
from diagnosis.next_test.linear_search import LinearSearch
from diagnosis.next_test.predicted_verdict import PredictedVerdict
from diagnosis.settings import SETTINGS, DiagnosisSettings
from identification import lines_are_independent
from identification.words import group_by_key
from tuning import Session

Row = TypeVar("Row")


@dataclass(frozen=True)
class SmallestSize:
    """The smallest size of an effect at a place that nine tests of ten show.

    Args:
        effect: name of the effect.
        location: place in the verdict.
        dof: direction or test in the verdict; empty without one.
        parameter: parameter of the verdict that states the size; empty if none follows the size.
        value: value of that parameter at the smallest size, the length of a vector; None where no
            size is found, or without such a parameter.
        of_usual: that size over a usual one; None where no usual size is known.
        is_found: whether a size is found.
        gain: gain in log likelihood of a fit at that size; 0 without one [nats].
        confused: effects and places with a cosine of at least 0.9.
    """

    effect: str
    location: str
    dof: str
    parameter: str
    value: float | None
    of_usual: float | None
    is_found: bool
    gain: float
    confused: tuple[str, ...]


def predict_smallest_sizes(
    session: Session,
    effects: Sequence[str] = (),
    places: Sequence[str] = (),
    settings: DiagnosisSettings = SETTINGS,
) -> list[SmallestSize]:
    """Return the smallest size of every effect at every place.

    Effects that a law of a joint describes, or that data checks alone prove, have no prediction.

    Args:
        session: campaign and nominal model. The noise of the FRFs counts, not the FRFs.
        effects: names of effects; all if empty.
        places: places; all if empty.
    """
    scene = _set_scene(session, settings)
    hypotheses = propose_linear(scene)
    linear = LinearSearch.linearise(scene, hypotheses)
    verdict = PredictedVerdict(scene, linear)
    prediction = _Prediction(scene, linear, DrawnEffects(scene, linear), verdict)
    families = group_by_key(
        (hypothesis.key, hypothesis)
        for hypothesis in hypotheses
        if hypothesis.effect in (effects or (hypothesis.effect,))
        and hypothesis.location in (places or (hypothesis.location,))
    )
    return [row for shapes in families.values() for row in prediction.predict(shapes)]


def _set_scene(session: Session, settings: DiagnosisSettings) -> Scene:
    """Return the scene of the nominal model, whose rigid directions may give way."""
    released, directions = release_session(session)
    return Scene(
        released,
        released.parametrisation.fixed,
        directions,
        stride_factor=settings.schedule.find_stride_factor(session.campaign),
        settings=settings,
        has_independent_lines=lines_are_independent(session.campaign),
    )


@dataclass(frozen=True, eq=False)
class _Prediction:
    """Prediction of a test.

    Args:
        effects: effects in their shapes and directions.
        verdict: verdict on an effect of any size.
    """

    scene: Scene
    linear: LinearSearch
    effects: DrawnEffects
    verdict: PredictedVerdict

    def predict(self, shapes: Sequence[Hypothesis]) -> list[SmallestSize]:
        """Return the smallest size of an effect in each direction that the verdict may state.

        Args:
            shapes: hypotheses of one effect, place and direction.
        """
        by_direction = group_by_key((effect.dof, effect) for effect in self.effects.draw(shapes))
        return [self._predict_direction(drawn) for drawn in by_direction.values()]

    def _predict_direction(self, drawn: Sequence[SizedEffect]) -> SmallestSize:
        """Return the smallest size of an effect over its shapes, the smallest size first."""
        weak = self._pick(drawn)
        effect, location, _ = weak.hypothesis.key
        confused = self.verdict.find_confused(weak)
        row = SmallestSize(effect, location, weak.dof, "", None, None, False, 0.0, confused)
        if not weak.is_sized:
            null = self.linear.refit(weak.moved)
            is_named = self.verdict.is_named(weak, 1.0, self.verdict.rank_rivals(weak, 1.0))
            return replace(row, is_found=is_named, gain=null.cost)
        strength = self._find_threshold(weak)
        if strength is None:
            return row
        noise = ndtri((np.arange(10) + 0.5) / 10)  # tenths of the size that a fit finds
        rows = list(product(drawn, np.maximum(strength + noise, 0.0).tolist()))
        rows.sort(key=lambda pair: pair[0].size * pair[1])
        typical, size = self._pick(rows)
        parameter, value = self.effects.state_size(typical, size)
        gain = self.linear.refit(size * typical.moved).cost
        return replace(row, parameter=parameter, value=value, is_found=True, gain=gain)

    def _pick(self, rows: Sequence[Row]) -> Row:
        """Return the row that nine of ten do not exceed."""
        return rows[int(np.ceil(self.scene.settings.predicted_share * len(rows))) - 1]

    def _find_threshold(self, effect: SizedEffect) -> float | None:
        """Return the size from which the effect is named; None if none within its bounds is.

        Rivals are ranked at the size from which it would be named without any.
        """
        alone = self._double(effect, 1.0, ())
        if alone is None:
            return None
        return self._double(effect, alone, self.verdict.rank_rivals(effect, alone))

    def _double(
        self, effect: SizedEffect, size: float, rivals: Sequence[Hypothesis]
    ) -> float | None:
        """Return the size from which an effect is named beside rivals, by doubling and halving."""
        low, (doublings, halvings) = size, self.scene.settings.predicted_size_steps
        for _ in range(doublings):
            if not self.effects.is_within_bounds(effect, size):
                return None
            if self.verdict.is_named(effect, size, rivals):
                break
            low, size = size, 2 * size
        else:
            return None
        for _ in range(halvings if size > low else 0):
            middle = float(np.sqrt(low * size))
            is_named = self.verdict.is_named(effect, middle, rivals)
            low, size = (low, middle) if is_named else (middle, size)
        return size
