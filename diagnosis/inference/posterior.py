r"""Posterior probabilities of sets of causes, each with or without a rest.

Every set S is fitted at its own model-error floor; c_S is its mean -ln L per value, P_S the cost of
its tolerances. The noise of n values is independent, but the error of a model is shared by lines,
channels and hits: with a share s of the noise in the variance, a residual holds

    N = 1 / [s^q / n + (1 - s^q) / n_e]

independent values (design effect, Kish 1965, ch. 5.4), n_e of the model's error; what neighbouring
lines do not share counts as noise. N is that of the most probable set: a set of many causes may
leave little but noise, and yet gain less than they pay. It then says nothing of the errors of a
smaller one. Relative to the empty set with a rest ("unexplained"), the log
probability is

    l_S = N (c_0 - c_S) + N_l ln[(1 + e_0) / (1 + e_S)] + w (P_0 - P_S) - k_S / 2 - n_S ln M,

where n_S is the number of its causes that no redundant channels prove, and k_S that of the fitted
parameters of all. Sets of the same effects have the same number, the most that a fit of them has: a
fit may end a hair from a bound at one place and at it elsewhere. The best of M hypotheses gains by
chance; ln M is the cost of a uniform prior, which a fault does not pay that redundant channels
prove without a model. By chance k parameters gain k / 2 nats on average (Wilks 1938). Fits weigh
tolerances against all n values, so that these absorb model error, and any cause relieves them:
their cost counts with a weight w far below 1, but no less than in the fits, N / n. n_e, q and w are
calibrated on virtual machines whose errors are known. Tests at several levels have a second term
(``gain_between_levels``): errors that all levels share cancel in the differences of residuals
between levels. The empty set without a rest ("none") has odds of

    p(none) / p(unexplained) = (hidden / gap)^(1 / width),

where ``hidden`` is the mean square of a gap that badly known noise may hide. A cause that only
releases tolerances is none if they then shift by no more than an outlier. The probability of
"unexplained" is divided among all places by a softmax of the gains of a free force. One effect at
places that the test cannot tell apart is one cause, with the probability of all (``places``).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import softmax

from diagnosis.inference.calibration import Calibration, load_calibration
from diagnosis.inference.evidence import Evidence, FittedSet, Key, Site, read_site
from diagnosis.inference.places import (
    Keys,
    Shares,
    group_places,
    sum_presence,
    weigh_places,
)
from diagnosis.settings import NEGLIGIBLE_SHARE, SETTINGS, DiagnosisSettings
from identification.words import first_by_key


@dataclass(frozen=True)
class Posterior:
    """Probabilities of sets of causes.

    Args:
        none: probability of the empty set without a rest.
        unexplained: probability of the empty set with a rest.
        several: probability of several causes.
        causes: causes with the probability that each is present, the most probable first; each at
            its likeliest place, with the probability of all places (``group_places``).
        where: places by their share.
        sets: sets of causes with their probabilities, the most probable first.
        groups: effect and places of each cause with several places, the likeliest first.
        apart: causes as above, each place by itself.
    """

    none: float
    unexplained: float
    several: float
    causes: Shares
    where: tuple[tuple[str, float], ...]
    sets: tuple[tuple[Keys, float], ...] = ()
    groups: tuple[tuple[Site, ...], ...] = ()
    apart: Shares = ()

    def list_places(self, key: Key) -> list[str]:
        """Return the places of a cause that this test cannot tell apart, the likeliest first."""
        alone = (read_site(key),)
        sites = next((group for group in self.groups if alone[0] in group), alone)
        return [location for _, location in sites]

    def find_confounded_pairs(
        self, settings: DiagnosisSettings = SETTINGS
    ) -> tuple[tuple[Site, Site], ...]:
        """Return pairs of causes in which sets differ that are about equally probable."""
        shares: dict[frozenset[Site], float] = {}
        for keys, share in self.sets:
            sites = frozenset(map(read_site, keys))
            shares[sites] = shares.get(sites, 0.0) + share
        likely = [row for row in shares.items() if row[1] >= settings.min_row_probability]
        pairs: list[tuple[Site, Site]] = []
        for (first, share), (second, less) in combinations(sorted(likely, key=lambda x: -x[1]), 2):
            differs_by_one = len(first - second) == len(second - first) == 1
            if differs_by_one and share < less * np.exp(settings.twin_nats):
                (more_probable,), (other_site,) = first - second, second - first
                pairs.append((more_probable, other_site))
        return tuple(dict.fromkeys(pairs))


def compute_posterior(
    evidence: Evidence,
    calibration: Calibration | None = None,
    settings: DiagnosisSettings = SETTINGS,
) -> Posterior:
    """Return the posterior probabilities of all sets that were fitted.

    Args:
        calibration: constants and their seeds; those committed if None.
    """
    constants = calibration or load_calibration()
    sets, gap = _remove_outliers(evidence, settings.outlier_sigma)
    sets = _select_best_fits(select_material_sets(evidence.null, sets, settings))
    log_none = (
        np.log(constants.hidden[evidence.gap_source]) - np.log(max(gap, NEGLIGIBLE_SHARE))
    ) / constants.hidden_width
    if evidence.unsteady:
        log_none = min(log_none, 0.0)
    logs = compute_log_odds(evidence, sets, constants)
    shares = softmax(np.concatenate([[log_none, 0.0], logs]))
    none, unexplained = (max(float(share), NEGLIGIBLE_SHARE) for share in shares[:2])
    probabilities = {
        fitted.keys: share for fitted, share in zip(sets, shares[2:].tolist(), strict=True)
    }
    if evidence.unknown:
        none, unexplained = NEGLIGIBLE_SHARE, min(none + unexplained, 1.0)
    if evidence.proven:  # corrected in every set: present with certainty
        probabilities = {
            (*evidence.proven, *keys): share for keys, share in probabilities.items()
        } | {evidence.proven: min(none + (0.0 if evidence.unknown else unexplained), 1.0)}
        none, unexplained = NEGLIGIBLE_SHARE, unexplained if evidence.unknown else 0.0
    several = sum(share for keys, share in probabilities.items() if _count_causes(keys) > 1)
    groups = group_places(probabilities, evidence.interchangeable, settings.twin_nats)
    apart = sum_presence(probabilities, [(site,) for group in groups for site in group], settings)
    return Posterior(
        none,
        unexplained,
        several,
        causes=sum_presence(probabilities, groups, settings),
        where=weigh_places(evidence, apart, unexplained, constants),
        sets=tuple(sorted(probabilities.items(), key=lambda row: -row[1])),
        groups=tuple(group for group in groups if len(group) > 1),
        apart=apart,
    )


def compute_log_odds(
    evidence: Evidence, sets: Sequence[FittedSet], constants: Calibration
) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """Return l_S of sets, relative to the empty set with a rest; (n_set,)."""
    if not sets:
        return np.zeros(0)
    null = evidence.null
    gains = np.array([null.cost - fitted.cost for fitted in sets])
    reliefs = np.array([null.prior - fitted.prior for fitted in sets])
    parameters = _count_parameters(evidence, sets) / 2
    causes = np.array([evidence.price_causes(fitted.keys) for fitted in sets])
    best = min(sets, key=lambda fitted: fitted.objective)
    while True:  # from the best fit to the set that is most probable at its N
        count = best.count_independent(constants)
        weight = max(constants.tolerance_weight, count / best.fitted_values)
        levels = np.array([each.gain_between_levels(null, best, constants) for each in sets])
        logs: np.ndarray[tuple[int], np.dtype[np.float64]] = (
            count * gains + levels + weight * reliefs - parameters - causes
        )
        most_probable = sets[int(logs.argmax())] if logs.max() > 0 else null
        if most_probable.count_independent(constants) >= count:
            return logs
        best = most_probable


def _count_parameters(
    evidence: Evidence, sets: Sequence[FittedSet]
) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """Return k_S of sets, the most that a fit with the same effects has; (n_set,)."""
    counts: dict[tuple[str, ...], int] = {}
    for fitted in (*evidence.sets, *sets):
        effects = _list_effects(fitted)
        counts[effects] = max(fitted.parameter_count, counts.get(effects, 0))
    return np.array([counts[_list_effects(fitted)] for fitted in sets], float)


def _list_effects(fitted: FittedSet) -> tuple[str, ...]:
    """Return the effects of a set in alphabetical order."""
    return tuple(sorted(effect for effect, _, _ in fitted.keys))


def select_material_sets(
    null: FittedSet, sets: Sequence[FittedSet], settings: DiagnosisSettings = SETTINGS
) -> list[FittedSet]:
    """Return the sets each of whose causes adds much beside the others.

    Sets that were not fitted tell nothing; that of the last cause is the null model then.

    Args:
        sets: sets of causes, each with the last added one at its end.
    """
    fits = {frozenset(fitted.keys): fitted for fitted in (*reversed(_select_best_fits(sets)), null)}

    def is_material(fitted: FittedSet) -> bool:
        sets_without = {key: frozenset(fitted.keys) - {key} for key in fitted.keys}
        fewer = [fits[without] for without in sets_without.values() if without in fits]
        if sets_without[fitted.keys[-1]] not in fits:
            fewer.append(null)
        return all(fitted.is_material_step(before, settings.min_closed, null) for before in fewer)

    return [fitted for fitted in sets if is_material(fitted)]


def _remove_outliers(evidence: Evidence, outlier: float) -> tuple[list[FittedSet], float]:
    """Return the sets without outliers of tolerances, and the gap that outliers do not explain."""
    gaps = [evidence.null.gap]
    kept = []
    for fitted in evidence.admitted_sets:
        shifts = fitted.shifts or (None,) * len(fitted.keys)
        is_outlier = [shift is not None and shift <= outlier for shift in shifts]
        if all(is_outlier):
            gaps.append(fitted.gap)
        elif not any(is_outlier):
            kept.append(fitted)
    return kept, min(gaps)


def _select_best_fits(sets: Sequence[FittedSet]) -> list[FittedSet]:
    """Return the best fit of each set of causes, among its shapes and starts."""
    ranked = sorted(sets, key=lambda fitted: fitted.objective)
    return list(first_by_key((frozenset(fitted.keys), fitted) for fitted in ranked).values())


def _count_causes(keys: Keys) -> int:
    """Return the number of causes of a set."""
    return len({read_site(key) for key in keys})
