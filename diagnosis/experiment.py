"""What to measure next: what separates the leading causes best, or confirms the one there is."""

from collections.abc import Sequence

import numpy as np

from diagnosis.diagnose import Diagnosis
from diagnosis.effects import PROVEN, catalogue
from diagnosis.evidence import Key
from diagnosis.refit import Refit
from identification import smooth_variance
from identification.words import Campaign, Complex, Dof, node_of
from mbmodel import Evaluator, Question
from tuning import thinned

_RIVAL = 0.05  # probability of a cause that is worth an experiment
_STRIDE = 8


def next_experiment(found: Diagnosis) -> str | None:
    """One sentence; None where nothing is missing.

    Args:
        found: the diagnosis.
    """
    word, causes = found.judged.word, found.judged.causes
    if word == "none":
        return None
    if word == "unexplained" or not causes:
        return _of_unknown(found)
    refits = {one.hypothesis.key: one for one in found.search.refits if one.hypothesis}
    rivals = [key for key, share in causes if share >= _RIVAL and key in refits]
    if len(rivals) > 1 and word == "explained":
        first, second = (refits[key] for key in rivals[:2])
        hit = _separating(found.session.campaign, first, second)
        if hit is not None:
            return _of_rivals(rivals, *hit)
    effect, place, dof = causes[0][0]
    known = catalogue().get(effect) or PROVEN[effect]
    return known.said(known.confirm, place, dof)


def _of_unknown(found: Diagnosis) -> str:
    """Where something pushes, and whether it depends on the level is not known yet."""
    places = [place for place, _ in found.judged.where]
    if places and places[0] in found.gate.unknown:
        sensor = places[0].partition(":")[2]
        return f"exchange {sensor}, its cable and its amplifier with those of another and repeat"
    where = f" at {places[0]}, where something pushes" if places else ""
    levels = {test.condition.level_n for test in found.session.campaign.tests}
    if len(levels) < 2:
        return (
            "repeat at a quarter and at four times the level: friction, backlash and hardening "
            f"change with it; look{where or ' at the joints'}"
        )
    return f"put sensors on both sides{where}, and hit there"


def _of_rivals(rivals: Sequence[Key], point: str, apart: float) -> str:
    one, other = (f"{effect}@{place}" for effect, place, _ in rivals[:2])
    return f"hit {point} as well: {one} and {other} foresee FRFs that differ by {apart:.2g} noises"


def _separating(campaign: Campaign, one: Refit, other: Refit) -> tuple[str, float] | None:
    """The point not hit yet where two refits differ most, and by how much.

    That is the root of the mean of |H - H'|^2 over the variance that the channels have on the
    average of their tests, over lines, channels and three directions.
    """
    thin = thinned(campaign, _STRIDE)
    layout = one.session.model.machine.layout
    hit = {test.condition.reference.point for test in campaign.tests}
    points = [p for p in layout.points if node_of(p) is not None and p not in hit]
    variance: dict[Dof, list[np.ndarray]] = {}
    for test in thin.tests:
        own = smooth_variance(test.estimate)[:, :, 0]
        for row, dof in enumerate(test.estimate.frf.outputs):
            if test.estimate.measured[row, 0]:
                variance.setdefault(dof.positive, []).append(own[:, row])
    outputs = tuple(variance)
    inputs = tuple(Dof.of(point, axis) for point in points for axis in range(3))
    if not inputs or not outputs:
        return None
    first, second = (_foreseen(fit, thin, outputs, inputs) for fit in (one, other))
    noise = np.array([np.mean(variance[dof], axis=0) for dof in outputs]).T
    known = noise > 0
    squares = np.abs(first - second) ** 2 / np.where(known, noise, np.inf)[:, :, None]
    apart = squares.mean(axis=(0, 1)).reshape(len(points), 3).mean(axis=1)
    best = int(apart.argmax())
    return points[best], float(np.sqrt(apart[best]))


def _foreseen(
    fit: Refit, campaign: Campaign, outputs: tuple[Dof, ...], inputs: tuple[Dof, ...]
) -> Complex:
    """FRFs of a refit; (n_freq, n_out, n_in)."""
    quantity = campaign.tests[0].estimate.frf.quantity
    question = Question(campaign.freq_hz, outputs, inputs, quantity)
    return Evaluator(fit.session.model, question).at(fit.fit.theta).values
