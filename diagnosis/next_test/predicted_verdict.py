"""Verdict that a diagnosis would reach on a change of the FRFs, from fits in closed form."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import find_variance_source
from diagnosis.inference.evidence import Evidence, FittedSet
from diagnosis.inference.posterior import compute_posterior
from diagnosis.next_test.drawn_effects import SizedEffect, is_sign
from diagnosis.next_test.linear_search import LinearSearch, PredictedFit
from diagnosis.refits.refit import find_shift


@dataclass(frozen=True, eq=False)
class PredictedVerdict:
    """Verdict on an effect, its rivals, and those that it is confused with."""

    scene: Scene
    linear: LinearSearch

    def is_named(self, effect: SizedEffect, size: float, rivals: Sequence[Hypothesis]) -> bool:
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

    def rank_rivals(self, effect: SizedEffect, size: float) -> list[Hypothesis]:
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

    def find_confused(self, effect: SizedEffect) -> tuple[str, ...]:
        """Return the other effects and places whose signature is nearly that of an effect."""
        moved = effect.moved / 1000  # so slight that no tolerance is at its bound
        linear, slope = self.linear, self.linear.projected @ moved
        least = self.scene.settings.min_twin_cosine**2 * float(moved @ slope) / 2
        bounds, cost = linear.bound_gains(slope), float(moved @ slope) / 2
        near = (rival for rival in self._list_rivals(effect) if bounds[rival] >= least)
        alike = (rival.site for rival in near if cost - linear.refit(moved, rival).cost >= least)
        return tuple(dict.fromkeys(alike))


def _count_parameters(hypothesis: Hypothesis) -> int:
    """Return the number of parameters that a fit gives a cause (``Refit.count_parameters``)."""
    narrow = {name for name, deviation in hypothesis.believed.items() if deviation < 1}
    added = {parameter.name for part in hypothesis.parts for parameter in part.parameters}
    return len({*added, *hypothesis.release} - {*hypothesis.follow, *hypothesis.held, *narrow})
