r"""What to measure next: what separates the leading causes best, or confirms the one there is.

Of rivals with probabilities p, fitted to what was measured, an experiment is foreseen to tell

    gain = sum over i, j of p_i p_j / sum(p)^2  D_ij   [nats],

the expected log of the odds that it moves (Lindley 1956). D_ij is what j still leaves of the
experiment if i is true, tuned anew to it and to all that was measured before:

    D_ij = min over dx of  |(H_i - H_j - J_j dx) / sigma|^2 + dx' (N_j + P) dx / 2
         = c - g' (N_j + P + N_new)^-1 g / 2,

N_j the normal equations of what was measured, P those of the priors, c, g and N_new cost, gradient
and normal equations of j against the FRFs that i foresees, with the noise of the tests there are. A
new hit is off by tolerances of its own, which are tuned with all others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.algorithm import Diagnosis
from diagnosis.effects import PROVEN, catalogue
from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import Key
from diagnosis.inference.posterior import Keys
from diagnosis.next_test.unexplained import of_unknown
from diagnosis.refits.refitting import Refit
from identification.words import (
    Campaign,
    Dof,
    Input,
    Real,
    is_hammer_point,
)
from mbmodel import (
    AddedPart,
    Change,
    Machine,
    Model,
    Parameter,
    Part,
    hammer_parts,
)
from tuning import (
    Misfit,
    Parametrisation,
    mean_channel_variance,
    parametrise,
    predict_tests,
    thin_lines,
)
from tuning.assessment.parameter_confidence import FREE_PRIOR_SD

_STRIDE = 8
_SURE = 30.0  # nats: who gains more decides, then the least effort does
_ALIKE = 3.0  # nats: what gains less tells nothing
_KNOWN = 0.1  # of a body's mass: a mass that is added
_KNOWN_MASS = "known_mass"
_MIN_RIVAL_PROBABILITY, _MAX_RIVALS = 0.05, 6  # of sets that an experiment is to tell apart


@dataclass(frozen=True, eq=False)
class Experiment:
    """Something that can be measured.

    Args:
        words: what to do.
        inputs: what is hit.
        parts: that a machine then has as well.
        undone: the cause that is taken out of the machine; None for none.
    """

    words: str
    inputs: tuple[Input, ...]
    parts: Callable[[Machine], tuple[Part, ...]] = lambda _: ()
    undone: Key | None = None


def next_experiment(found: Diagnosis) -> str | None:
    """One sentence; None where nothing is missing.

    Args:
        found: the diagnosis.
    """
    word, causes = found.present.word, found.posterior.causes
    if word == "none":
        return None
    if word == "unexplained" or not causes:
        proven = [f"{_confirmed(cause.key)}; then " for cause in found.present.causes]
        return "".join(proven) + of_unknown(found)
    rivals = find_rivals(found)
    if len(rivals) > 1:
        known = [(refit, share) for _, refit, share in rivals]
        best, gain = best_experiment(found.session.campaign, known)
        (one, _, _), (other, _, _), *_ = rivals
        if gain > _ALIKE:
            told = f"{_without(one, other)} from {_without(other, one)}"
            return f"{best.words}: foreseen to tell {told} by {gain:.2g} nats"
    return _confirmed(causes[0][0])


def find_rivals(found: Diagnosis) -> list[tuple[Keys, Refit, float]]:
    """Return sets of as many causes as the verdict names, any of which may be present.

    Args:
        found: the diagnosis.

    Returns:
        Causes, refit and probability of each set, the most probable first.
    """
    count = len(found.present.causes) - len(found.gate_hypotheses)
    proven = {cause.key for cause in found.gate_hypotheses}
    rivals = []
    for keys, share in found.posterior.sets:
        added = tuple(key for key in keys if key not in proven)
        refit = found.search.refit_of(added)
        if share >= _MIN_RIVAL_PROBABILITY and len(added) == max(count, 1) and refit is not None:
            rivals.append((added, refit, share))
    return rivals[:_MAX_RIVALS]


def _without(several: Keys, others: Keys) -> str:
    """Those that are not among others, such as ``appendage@body:ty``."""
    own = [key for key in several if key not in others]
    return " and ".join(f"{effect}@{place}" for effect, place, _ in own)


def _confirmed(cause: Key) -> str:
    """What confirms a cause."""
    effect, place, dof = cause
    known = catalogue().get(effect) or PROVEN[effect]
    return known.said(known.confirm, place, dof)


def best_experiment(
    campaign: Campaign, rivals: Sequence[tuple[Refit, float]]
) -> tuple[Experiment, float]:
    """What tells rivals apart best, and its gain in nats; of what decides the least effort.

    Args:
        campaign: what was measured.
        rivals: refits with their probabilities.
    """
    thin = thin_lines(campaign, _STRIDE)
    before = {one: _before(one) for one, _ in rivals}
    best: tuple[Experiment, float] | None = None
    for several in _by_effort(campaign, [one for one, _ in rivals]):
        for asked in several:
            gain = _gain(asked, thin, len(campaign.freq_hz), rivals, before)
            if best is None or gain > best[1]:
                best = asked, gain
        if best is not None and best[1] > _SURE:
            break
    if best is None:
        raise ValueError("a campaign without hits has no experiment")
    return best


def _by_effort(campaign: Campaign, rivals: Sequence[Refit]) -> Iterator[list[Experiment]]:
    """Further hits; then causes that can be taken out of the machine; then known masses."""
    machine = rivals[0].session.model.machine
    layout = machine.layout
    measured = campaign.inputs
    hits = []
    for point in layout.points:
        if point not in layout.sensors and not is_hammer_point(point):
            continue
        directions = (Dof.of(point, axis) for axis in range(3))
        inputs = tuple(dof for dof in directions if dof not in measured)
        if inputs:
            axes = " and ".join(dof.direction[2:] for dof in inputs)
            along = "" if len(inputs) == 3 else f" along {axes}"
            hits.append(Experiment(f"hit {point}{along} as well", inputs, _hammers(inputs)))
    yield hits
    undone = []
    for key in dict.fromkeys(one.key for rival in rivals for one in _members(rival)):
        effect, place, dof = key
        known = catalogue()[effect]
        if known.undoes:
            words = known.said(known.confirm, place, dof)
            undone.append(Experiment(words, measured, undone=key))
    yield undone
    yield [
        Experiment(
            f"add {_KNOWN * float(machine.body_mass[6 * k, 6 * k]):.2g} kg at {body} and repeat",
            measured,
            _known_mass(k),
        )
        for k, body in enumerate(layout.bodies)
    ]


def _members(rival: Refit) -> tuple[Hypothesis, ...]:
    """Its causes, each."""
    return rival.causes


def _hammers(inputs: tuple[Dof, ...]) -> Callable[[Machine], tuple[Part, ...]]:
    return lambda machine: hammer_parts(machine, inputs)


def _known_mass(body: int) -> Callable[[Machine], tuple[Part, ...]]:
    """A mass at a body's centre of mass, a tenth of its own."""

    def parts(machine: Machine) -> tuple[Part, ...]:
        frame = np.zeros((len(machine.body_mass), 3))
        frame[6 * body : 6 * body + 3] = np.eye(3)
        core = np.zeros((1, 3, 3, 3))
        core[0, 2] = _KNOWN * machine.body_mass[6 * body, 6 * body] * np.eye(3)
        own = Parameter(_KNOWN_MASS, 1.0, "1", positive=False)
        place = f"body:{machine.layout.bodies[body]}"
        return (AddedPart.linear(place, (own,), (Change("body", frame, frame, core),)),)

    return parts


def _gain(
    asked: Experiment,
    thin: Campaign,
    lines: int,
    rivals: Sequence[tuple[Refit, float]],
    before: Mapping[Refit, Real],
) -> float:
    """Nats that an experiment is foreseen to gain."""
    total = sum(share for _, share in rivals)
    posed = {one: _posed(asked, one) for one, _ in rivals}
    noise, gain = mean_channel_variance(thin), 0.0
    for true, share in rivals:
        told = predict_tests(posed[true].model, posed[true].theta, thin, noise, asked.inputs)
        for rival, other in rivals:
            if rival is not true:
                left = _left(posed[rival], told, before[rival], lines / len(thin.freq_hz))
                gain += share * other * left / total**2
    return gain


@dataclass(frozen=True, eq=False)
class _Posed:
    """A rival in an experiment: its model, where it stands, and what cannot vary."""

    model: Model
    theta: Real
    parametrisation: Parametrisation
    pinned: frozenset[str]
    floor: float


def _posed(asked: Experiment, rival: Refit) -> _Posed:
    session = rival.session
    model = Model(
        session.model.machine, (*session.model.parts, *asked.parts(session.model.machine))
    )
    theta = np.append(rival.fit.theta, model.drawn[len(rival.fit.theta) :])
    names = [parameter.name for parameter in model.parameters]
    pinned = {_KNOWN_MASS}
    for one in _members(rival):
        if one.key == asked.undone:
            pinned |= set(one.coordinates)
            theta = np.where(np.isin(names, one.coordinates), model.drawn, theta)
    varies = session.parametrisation.extend(parametrise(model, session.campaign.tolerance))
    return _Posed(model, theta, varies, frozenset(pinned), rival.floor)


def _left(rival: _Posed, told: Campaign, before: Real, times: float) -> float:
    """D: what a rival leaves of foreseen FRFs, tuned to them and to what was measured."""
    varies = rival.parametrisation
    problem = Misfit(rival.model, told, varies, model_error_floor=rival.floor)
    x = varies.coordinates(rival.theta)
    value, gradient, normal = problem.quadratic_model(x)
    cost = (value - problem.prior(x)) * times
    slope = (gradient - np.where(varies.has_prior, x, 0.0)) * times
    whole = normal.dense() * times
    whole[: len(before), : len(before)] += before
    whole += np.diag(np.where(varies.has_prior, 1.0, FREE_PRIOR_SD**-2))
    free = np.array([name not in rival.pinned for name in varies.names])
    scale = 1 / np.sqrt(np.diag(whole)[free])
    inner = whole[np.ix_(free, free)] * np.outer(scale, scale)
    own = scale * slope[free]
    return max(float(cost - own @ np.linalg.solve(inner, own) / 2), 0.0)


def _before(rival: Refit) -> Real:
    """Normal equations of what was measured; (n_x, n_x)."""
    session = rival.session
    thin = thin_lines(session.campaign, _STRIDE)
    problem = Misfit(session.model, thin, session.parametrisation, model_error_floor=rival.floor)
    x = session.parametrisation.coordinates(rival.fit.theta)
    times = len(session.campaign.freq_hz) / len(thin.freq_hz)
    found: Real = problem.quadratic_model(x)[2].dense() * times
    return found
