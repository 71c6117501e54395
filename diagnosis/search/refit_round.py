"""One round of the search: score tests about a set of causes, and refits with one more cause."""

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.data_checks.bending_bodies import key_of
from diagnosis.data_checks.candidates import build_candidates
from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import ForceGain
from diagnosis.levels.law_hypothesis import LawPart
from diagnosis.levels.refit_laws import refit_laws
from diagnosis.null_model import Baseline
from diagnosis.refits.refit import Refit
from diagnosis.search.drawn_starts import refit_from_drawing, refit_members_anew
from diagnosis.search.free_force import fit_free_forces
from diagnosis.search.local_gap import acts_at, list_further_peaks
from diagnosis.search.local_starts import begin_along
from diagnosis.search.one_level import CauseSearch, Trial
from diagnosis.search.score_test import Score, scores, select_best_of_sites
from diagnosis.search.stiffness_starts import has_square_matrix, rank_by_stiffness
from diagnosis.settings import DiagnosisSettings
from tuning import STAGES, FloorSchedule, Stage, is_gap_visible


def score_hypotheses(
    scene: Scene, base: Refit, excluded: frozenset[str], settings: DiagnosisSettings
) -> list[Score]:
    """Score all hypotheses about a refit, the most promising first.

    Against a state before a change, fits in dynamic stiffness score them where the tests allow it.
    Families are left out there: a matrix of free sizes explains any change of a square matrix.
    Where a law of a joint direction is a cause, no other law of it is sought, and no effect whose
    Part the machine before a change has.
    """
    inner = move_scene(scene, base)
    sites = {cause.site for cause in base.causes}
    with_law = {part.spring for part in base.session.model.parts if isinstance(part, LawPart)}
    present_names = {parameter.name for parameter in base.session.model.parameters}
    hypotheses = [
        hypothesis
        for effect in load_catalogue().values()
        for hypothesis in effect(inner)
        if hypothesis.location not in excluded and hypothesis.site not in sites
        if not any(p.name in present_names for part in hypothesis.parts for p in part.parameters)
        if hypothesis.spring is None or hypothesis.spring.spring not in with_law
    ]
    campaign = inner.session.campaign
    is_after = all(test.condition.state == "after" for test in campaign.tests)
    if is_after and has_square_matrix(campaign):
        hypotheses = [each for each in hypotheses if each.spring is None and each.member is None]
        return rank_by_stiffness(inner, base, hypotheses, settings.score_stride)
    return scores(inner, base.fit, hypotheses, base.floor, settings.score_stride)


def list_excluded(base: Baseline) -> frozenset[str]:
    """Return the places of proven faults, where no other cause is sought."""
    return frozenset(hypothesis.location for hypothesis in base.proven)


def move_scene(scene: Scene, base: Refit) -> Scene:
    """Return the scene of a refit: further hypotheses are proposed about it."""
    return replace(scene, session=base.session, theta=base.fit.theta)


def push_about(scene: Scene, base: Refit, settings: DiagnosisSettings) -> tuple[ForceGain, ...]:
    """Return the free force of each place that explains most of what a refit leaves."""
    floor = settings.force_floor_ratio * base.floor
    return fit_free_forces(move_scene(scene, base), base.fit, floor)


def refit_round(
    base: Baseline,
    current: Refit,
    ranked: Sequence[Score],
    settings: DiagnosisSettings,
    force: ForceGain | None = None,
) -> list[Refit]:
    """Refit the promising hypotheses; where a rest remains, others from distant starts.

    These are the best one, with its further shapes, and those without a slope.

    Args:
        current: set beside which they are refitted.
        ranked: their scores, the most promising first.
        force: force of any spectrum that explains much of the gap: the best hypothesis of each
            effect there, and that in its direction, are promising, whatever their scores. So are
            the other peaks of the scans, if a rest remains.
    """
    scene, search = base.scene, CauseSearch.beside(base.scene, current, settings)
    promising = _select_promising(ranked, force, settings)
    linear = [hypothesis for hypothesis in promising if hypothesis.spring is None]
    laws = _add_directions([law for law in promising if law not in linear], ranked, settings)
    linear += begin_along(scene, search.seen, ranked, force, settings)
    trials: list[Trial] = [(hypothesis, ()) for hypothesis in linear]
    trials += [
        (hypothesis, _first_stages(hypothesis, settings))
        for hypothesis in _suggest_candidates(base, current, settings)
    ]
    refits = search.refit(trials)
    if not search.is_on_one_level:
        if not current.causes:
            refits += refit_from_drawing(scene, refits, settings)
        refits += refit_laws(scene, base.null, current, laws, refits, settings)
    best = min(refits, key=lambda refit: refit.objective, default=None)
    if best is not None and is_gap_visible(best.gap):
        distant = _list_without_slope(ranked, best.causes[-1])
        further = [
            *_list_variants(best.causes[-1], ranked, refits, settings),
            *(trial for rival in distant for trial in _list_distant_starts(rival, settings)),
        ]
        shapes = {hypothesis for hypothesis, _ in further}
        # About the null model further peaks mostly belong to what a stronger cause explains.
        count = settings.max_refits if current.causes else settings.max_variants
        peaks = list_further_peaks(ranked, None if force is None else force.location, count)
        refits += search.refit([*further, *((peak, ()) for peak in peaks if peak not in shapes)])
        refits += refit_members_anew(scene, search.seen, ranked, refits, settings)
    if search.is_on_one_level:
        hypotheses = len({score.hypothesis.site for score in ranked})
        refits = search.finish(refits, trials, hypotheses, tuple(map(key_of, base.checks.small)))
        refits += refit_laws(scene, base.null, current, laws, refits, settings)
    return refits


def _list_variants(
    cause: Hypothesis, ranked: Sequence[Score], refits: Sequence[Refit], settings: DiagnosisSettings
) -> list[Trial]:
    """Return other starts and shapes of a cause."""
    refitted = {refit.causes[-1] for refit in refits}
    further = [
        score.hypothesis
        for score in ranked
        if score.hypothesis.site == cause.site
        and score.hypothesis not in refitted
        and score.hypothesis.spring is None
    ]
    shapes = _one_each_direction(further)[: settings.max_variants]
    return [*_list_distant_starts(cause, settings), *((shape, ()) for shape in shapes)]


def _select_promising(
    ranked: Sequence[Score], force: ForceGain | None, settings: DiagnosisSettings
) -> list[Hypothesis]:
    """Return the most promising hypotheses, one for each effect and place, and those of a force.

    The laws of one joint count as one, since they have one score. Members of families count as
    none: their gain is that of many free sizes. Tuned stiffness may have made up for a strong
    effect, so that it scores below the same effect in another direction.
    """
    chosen: list[Hypothesis] = []
    slots: set[tuple[str, str]] = set()
    for score in select_best_of_sites(ranked):
        hypothesis = score.hypothesis
        effect = hypothesis.effect if hypothesis.spring is None else "law"
        slots |= set() if score.is_of_family else {(effect, hypothesis.location)}
        if len(slots) > settings.max_refits:
            break
        chosen.append(hypothesis)
    best = [score.hypothesis for score in select_best_of_sites(ranked)]
    place = None if force is None else force.location
    at_place = [hypothesis for hypothesis in best if acts_at(hypothesis, place)]
    return list(dict.fromkeys((*chosen, *at_place)))


def _add_directions(
    laws: Sequence[Hypothesis], ranked: Sequence[Score], settings: DiagnosisSettings
) -> list[Hypothesis]:
    """Return laws with those in further directions of the most promising joint.

    Scores hardly tell whether a body shifts or tilts on a joint far from its centre of mass.
    """
    places = {law.location for law in laws[:1]}
    in_joint = [
        score.hypothesis
        for score in ranked
        if score.hypothesis.spring is not None and score.hypothesis.location in places
    ]
    directions = list(dict.fromkeys(law.spring for law in in_joint))[: 1 + settings.max_variants]
    further = [law for law in in_joint if law.spring in directions and law not in laws]
    return [*laws, *further]


def _suggest_candidates(
    base: Baseline, current: Refit, settings: DiagnosisSettings
) -> list[Hypothesis]:
    """Return the faults that redundant channels prove and that no cause of the set is yet."""
    sites = {cause.site for cause in current.causes}
    session = base.scene.session
    return [
        hypothesis
        for hypothesis in build_candidates(base.checks, session, settings)
        if hypothesis.site not in sites and (hypothesis.reform is None or not current.causes)
    ]


def _first_stages(hypothesis: Hypothesis, settings: DiagnosisSettings) -> tuple[Stage, ...]:
    """Return the first stage of a fit whose start is a guess, as that of a body's mode.

    Tolerances are held in it: they would make up for a mode that is still at a wrong frequency.
    """
    return () if hypothesis.reform is None else _distant_stages(settings.schedule)[:1]


def _distant_stages(schedule: FloorSchedule) -> tuple[Stage, ...]:
    """Return two stages with a logarithmic residual and large floors, for distant starts.

    Each has at most as many steps as all turns at a floor together: those that fail never end.
    """
    first, second = STAGES[1:3]
    steps = schedule.max_turns * schedule.max_steps
    return replace(first, max_steps=steps), replace(second, stride=first.stride, max_steps=steps)


def _one_each_direction(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the best shape of each direction, then further shapes."""
    first: dict[str | None, Hypothesis] = {}
    for hypothesis in hypotheses:
        first.setdefault(hypothesis.dof, hypothesis)
    chosen = list(first.values())
    rest = [hypothesis for hypothesis in hypotheses if hypothesis not in chosen]
    return [*chosen, *rest]


def _list_without_slope(ranked: Sequence[Score], best: Hypothesis) -> list[Hypothesis]:
    """Return the other hypotheses whose score tells little, as a direction drawn rigid."""
    hypotheses = [score.hypothesis for score in ranked]
    return [rival for rival in hypotheses if not rival.is_slope_informative and rival is not best]


def _list_distant_starts(hypothesis: Hypothesis, settings: DiagnosisSettings) -> list[Trial]:
    """Return distant starts of a cause, where a strong effect may be found."""
    stages = _distant_stages(settings.schedule)
    return [
        (replace(hypothesis, begin={**hypothesis.begin, **start}), stages)
        for start in hypothesis.otherwise[: settings.max_variants]
    ]
