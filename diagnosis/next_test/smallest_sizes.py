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

import numpy as np
from scipy.stats import norm

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import find_variance_source
from diagnosis.inference.evidence import Evidence, FittedSet, Key
from diagnosis.inference.posterior import compute_posterior
from diagnosis.next_test.drawn_effects import DrawnEffects, SizedEffect, is_sign, propose_linear
from diagnosis.next_test.linear_search import LinearSearch, PredictedFit
from diagnosis.refits.refit import find_shift
from diagnosis.released_session import release_session
from diagnosis.settings import SETTINGS, DiagnosisSettings
from identification import lines_are_independent
from tuning import Session

NINE_OF_TEN = 0.9
_SLIGHT = 1e-3  # size at which all is linear
_NOISE_QUANTILES = norm.ppf((np.arange(10) + 0.5) / 10)  # of the size that a fit finds
_MAX_SIZE_DOUBLINGS = 12  # of a size, from the standard deviation of the one that a fit finds
_HALVINGS = 5  # of the last doubling: to two per cent


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
        settings: thresholds and sizes of the search.
    """
    scene = _set_scene(session, settings)
    hypotheses = propose_linear(scene)
    linear = LinearSearch.linearise(scene, hypotheses)
    prediction = _Prediction(scene, linear, DrawnEffects(scene, linear))
    families: dict[Key, list[Hypothesis]] = {}
    for hypothesis in hypotheses:
        if hypothesis.effect in (effects or (hypothesis.effect,)) and hypothesis.location in (
            places or (hypothesis.location,)
        ):
            families.setdefault(hypothesis.key, []).append(hypothesis)
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
        scene: campaign and nominal model.
        linear: normal equations of the test.
        effects: effects in their shapes and directions.
    """

    scene: Scene
    linear: LinearSearch
    effects: DrawnEffects

    def predict(self, shapes: Sequence[Hypothesis]) -> list[SmallestSize]:
        """Return the smallest size of an effect in each direction that the verdict may state.

        Args:
            shapes: hypotheses of one effect, place and direction.
        """
        by_direction: dict[str, list[SizedEffect]] = {}
        for effect in self.effects.draw(shapes):
            by_direction.setdefault(effect.dof, []).append(effect)
        return [self._predict_direction(drawn) for drawn in by_direction.values()]

    def _predict_direction(self, drawn: Sequence[SizedEffect]) -> SmallestSize:
        """Return the smallest size of an effect over its shapes, the smallest size first."""
        weak = drawn[_count_nine_of_ten(drawn) - 1]
        effect, location, _ = weak.hypothesis.key
        confused = self._find_confused(weak)
        row = SmallestSize(effect, location, weak.dof, "", None, None, False, 0.0, confused)
        if not weak.is_sized:
            null = self.linear.refit(weak.moved)
            is_named = self._is_named(weak, 1.0, self._rank_rivals(weak, 1.0))
            return replace(row, is_found=is_named, gain=null.cost)
        strength = self._find_threshold(weak)
        if strength is None:
            return row
        rows = list(product(drawn, np.maximum(strength + _NOISE_QUANTILES, 0.0).tolist()))
        rows.sort(key=lambda pair: pair[0].size * pair[1])
        typical, size = rows[_count_nine_of_ten(rows) - 1]
        parameter, value = self.effects.state_size(typical, size)
        gain = self.linear.refit(size * typical.moved).cost
        return replace(row, parameter=parameter, value=value, is_found=True, gain=gain)

    def _find_threshold(self, effect: SizedEffect) -> float | None:
        """Return the size from which the effect is named; None if none within its bounds is.

        Rivals are ranked at the size from which it would be named without any.
        """
        alone = self._double(effect, 1.0, ())
        if alone is None:
            return None
        return self._double(effect, alone, self._rank_rivals(effect, alone))

    def _double(
        self, effect: SizedEffect, size: float, rivals: Sequence[Hypothesis]
    ) -> float | None:
        """Return the size from which an effect is named beside rivals, by doubling and halving."""
        low = size
        for _ in range(_MAX_SIZE_DOUBLINGS):
            if not self.effects.is_within_bounds(effect, size):
                return None
            if self._is_named(effect, size, rivals):
                break
            low, size = size, 2 * size
        else:
            return None
        for _ in range(_HALVINGS if size > low else 0):
            middle = float(np.sqrt(low * size))
            is_named = self._is_named(effect, middle, rivals)
            low, size = (low, middle) if is_named else (middle, size)
        return size

    def _is_named(self, effect: SizedEffect, size: float, rivals: Sequence[Hypothesis]) -> bool:
        """Return whether the diagnosis names an effect of a size at its place."""
        linear, settings, cause = self.linear, self.scene.settings, effect.hypothesis
        moved = size * effect.moved
        null, known = linear.refit(moved), linear.refit(moved, cause)
        fits = [(cause, known)]
        fits += [(rival, linear.refit(moved, rival)) for rival in rivals]
        explained = settings.min_place_cosine**2 * (null.cost - known.cost)
        alike = [
            hypothesis.key[:2]
            for hypothesis, fit in fits[1:]
            if hypothesis.effect == cause.effect and null.cost - fit.cost >= explained
        ]
        evidence = Evidence(
            null=self._summarise(None, null),
            sets=tuple(self._summarise(*fit) for fit in fits),
            hypotheses=linear.count_sites,
            variance=find_variance_source(self.scene.session.campaign),
            interchangeable=tuple((cause.key[:2], site) for site in alike),
        )
        posterior = compute_posterior(evidence, settings=settings)
        return any(
            share > settings.min_probability
            and key[0] == cause.effect
            and cause.location in posterior.list_places(key)
            for key, share in posterior.causes
        )

    def _rank_rivals(self, effect: SizedEffect, size: float) -> list[Hypothesis]:
        """Return the most promising other effects and places, as a round of the search has them."""
        moved = size * effect.moved
        ranked = self.linear.rank(self._list_rivals(effect), moved, self.linear.refit(moved))
        return ranked[: self.scene.settings.max_refits]

    def _list_rivals(self, effect: SizedEffect) -> list[Hypothesis]:
        """Return the hypotheses of other effects and places.

        An effect that is there or not has one size, at which one of any size is no rival.
        """
        site = effect.hypothesis.site
        return [
            hypothesis
            for hypothesis in self.linear.hypotheses
            if hypothesis.site != site and is_sign(hypothesis) is not effect.is_sized
        ]

    def _summarise(self, hypothesis: Hypothesis | None, refit: PredictedFit) -> FittedSet:
        """Return a fit as the plain numbers of the posterior."""
        gap, values = refit.gap / self.linear.fitted_values, self.linear.fitted_values
        shift, parameters, doubt = None, 0, self.linear.gap_doubt
        if hypothesis is not None:
            shift = find_shift(hypothesis, refit.step)
            parameters = _count_parameters(hypothesis) - int((refit.step == 0).sum())
            doubt = 0.0
        return FittedSet(
            keys=() if hypothesis is None else (hypothesis.key,),
            floor=0.0,
            cost=1 + float(np.log1p(gap)),
            prior=refit.prior,
            values=2 * values,  # the statistics of a residual count twice as many lines
            fitted_values=values,
            noise_share=1 / (1 + gap),
            effective_values=float(values),
            chi_square=1 + gap,
            serial=gap - doubt if self.scene.has_independent_lines else None,
            doubt=doubt,
            shifts=() if hypothesis is None else (shift,),
            parameters=() if hypothesis is None else (parameters,),
        )

    def _find_confused(self, effect: SizedEffect) -> tuple[str, ...]:
        """Return the other effects and places whose signature is nearly that of an effect."""
        moved = _SLIGHT * effect.moved  # no tolerance is at its bound
        linear, left = self.linear, self.linear.projected @ moved
        least = self.scene.settings.min_twin_cosine**2 * float(moved @ left) / 2
        bounds, cost = linear.bound_gains(left), float(moved @ left) / 2
        near = (rival for rival in self._list_rivals(effect) if bounds[rival] >= least)
        alike = (rival.site for rival in near if cost - linear.refit(moved, rival).cost >= least)
        return tuple(dict.fromkeys(alike))


def _count_nine_of_ten(rows: Sequence[object]) -> int:
    return int(np.ceil(NINE_OF_TEN * len(rows)))


def _count_parameters(hypothesis: Hypothesis) -> int:
    """Return the number of parameters that a fit gives a cause (``Refit.count_parameters``)."""
    narrow = {name for name, deviation in hypothesis.believed.items() if deviation < 1}
    added = {parameter.name for part in hypothesis.parts for parameter in part.parameters}
    return len({*added, *hypothesis.release} - {*hypothesis.follow, *hypothesis.held, *narrow})
