r"""Rivals by what they foretell: lines, and hits along a direction, that their fits did not see.

A fit follows its own data; what it says of others tells whether the cause is the right one. Of a
refit, with theta_b that of all lines but fold b of the blocks, u the squares of what it leaves of
fold b over the noise, J the least cost, with priors, of all hits and J_-t of all but those along
one direction (where all are along one: but one test), both from the same theta by the same steps,

    score = 1/2 sum_b sum (v + 1) log(1 + u / v) + 1/2 sum_t (J - J_-t)   [nats].

Beside a sharp mode theta_b is not known so well, and a few values are off by a hundred times the
noise, of any model: so lines count by the density of a noise whose variance is known as from v = 2
values (Student), like (v + 1) / v u where u is small. A hit that no fit saw is off by tolerances of
its own, which would hide all else: J - J_-t is what is left of it when these are tuned, with all
that the others leave uncertain. What no model holds makes rivals differ in proportion to how many
values there are: of twice as many as are enough for fits half the score counts.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.inference.posterior import Keys, Posterior
from diagnosis.null_model import with_outliers
from diagnosis.refits.parallel import Call, side_by_side
from diagnosis.refits.refitting import SOME, Refit, fitted, further, held_out, paced, plenty
from diagnosis.search.ladder import Search
from identification.words import Campaign, Dof, Real
from tuning import HeldOutFits, Misfit, thin_lines

_RIVAL, _RIVALS = 0.05, 6  # probability of a cause that is worth a comparison, and how many are
_KNOWN = 2.0  # values by which a noise's variance is known where lines were left out


def rivals_of(judged: Posterior, found: Search) -> list[tuple[Keys, Refit, float]]:
    """Causes, or pairs of them, each of which may be what is there, with their probabilities.

    As many at once as the verdict says are there beside what gates proved.
    """
    fits: dict[Keys, Refit] = {(one.key,): one for one in found.refits if one.key}
    pairs = ((one.hypothesis.members, one) for one in found.pairs if one.hypothesis)
    fits |= {tuple(member.key for member in members): one for members, one in pairs}
    present = set(judged.present)
    own = (keys for keys, _ in judged.sets if present.issuperset(keys))
    many = max(map(len, own), default=0)
    likely = sorted(judged.sets, key=lambda one: -one[1])
    rivals = [
        (keys, fits[keys], share)
        for keys, share in likely
        if share >= _RIVAL and len(keys) == many and keys in fits
    ]
    return rivals[:_RIVALS]


def at_ease(scene: Scene, found: Search, judged: Posterior, outlier: float) -> Search:
    """The same, tolerances of rivals beyond their bounds where an outlier explains what is left.

    A tolerance that is off by three standard deviations leaves more at its bound than rivals differ
    by, and both are then judged by how they bend to hide it.

    Args:
        scene: of the search.
        found: what was tried.
        judged: by it.
        outlier: standard deviations that a tolerance may have.
    """
    rivals = [one for _, one, _ in rivals_of(judged, found)]
    if len(rivals) < 2 or all(one.left(outlier) >= one.gap for one in rivals):
        return found
    eased = {one: with_outliers(scene, one, outlier)[1] for one in rivals}
    refits = sorted((eased.get(one, one) for one in found.refits), key=lambda one: one.cost)
    pairs = sorted((eased.get(one, one) for one in found.pairs), key=lambda one: one.cost)
    return replace(found, refits=tuple(refits), pairs=tuple(pairs))


def foretold(scene: Scene, rivals: Sequence[Refit]) -> list[float | None]:
    """Scores of refits, the less the better; None where nothing can be left out.

    Args:
        scene: how many lines count, and how many processes.
        rivals: refits to the same data.
    """
    (stage,) = paced((SOME,), scene.pace)
    sent = [replace(one, hypothesis=None) for one in rivals]
    calls: list[Call] = [(held_out, (one, stage, 1, None)) for one in sent]
    lines = [
        None if held is None else _of_lines(one, held)
        for one, held in zip(rivals, side_by_side(calls, scene.jobs), strict=True)
    ]
    parts = [_parts(one.session.campaign) for one in rivals]
    tasks = [
        further(_without(one, part), (SOME,))
        for one, own in zip(rivals, parts, strict=True)
        for part in ((), *own)
    ]
    made = iter([refit.fit.cost for refit in fitted(scene, tasks)])
    found: list[float | None] = []
    for one, own, by_lines in zip(rivals, parts, lines, strict=True):
        thin = thin_lines(one.session.campaign, stage.stride)
        times = len(one.session.campaign.freq_hz) / len(thin.freq_hz)
        # What these steps still gain of all hits is not what those left out cost.
        whole = min(_cost(one, one.fit.theta, thin), next(made))
        by_tests = sum(whole - next(made) for _ in own) * times if own else None
        scores = [score for score in (by_lines, by_tests) if score is not None]
        more = max(1.0, plenty(one.session.campaign))
        found.append(sum(scores) / len(scores) / more if scores else None)
    return found


def _of_lines(one: Refit, held: HeldOutFits) -> float:
    """What the fits without a fold leave of it."""
    varies, campaign = one.session.parametrisation, one.session.campaign
    found = 0.0
    for fold, theta in enumerate(held.thetas):
        if (held.folds == fold).any():
            lines = campaign.select_lines(held.folds == fold)
            problem = Misfit(one.session.model, lines, varies, model_error_floor=0.0)
            squares = problem.squared_residuals(varies.coordinates(theta))
            found += float(((_KNOWN + 1) * np.log1p(squares / _KNOWN)).sum())
    return found


def _parts(campaign: Campaign) -> list[tuple[int, ...]]:
    """Places of tests that are left out together: a direction, or if there is one alone a test."""
    along: dict[str, list[int]] = {}
    for place, test in enumerate(campaign.tests):
        reference = test.condition.reference
        key = reference.direction[1:] if isinstance(reference, Dof) else reference.name
        along.setdefault(key, []).append(place)
    groups = list(along.values()) if len(along) > 1 else [[k] for k in range(len(campaign.tests))]
    return [tuple(group) for group in groups] if len(groups) > 1 else []


def _without(one: Refit, part: tuple[int, ...]) -> Refit:
    tests = one.session.campaign.tests
    kept = tuple(test for place, test in enumerate(tests) if place not in part)
    campaign = replace(one.session.campaign, tests=kept)
    return replace(one, session=replace(one.session, campaign=campaign))


def _cost(one: Refit, theta: Real, campaign: Campaign) -> float:
    """In nats, priors and all."""
    varies = one.session.parametrisation
    problem = Misfit(one.session.model, campaign, varies, model_error_floor=0.0)
    return problem.value(varies.coordinates(theta))
