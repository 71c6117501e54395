"""Search for the causes: stepwise forward selection with backward elimination.

Each round scores every hypothesis about the best set so far, refits the most promising one of each
effect and place together with that set, and keeps the best if it is probable. Then each earlier
cause is left out in turn, and dropped if the set without it is as probable. A second effect is
found by a further round, from a model that has the first (Draper and Smith 1998, ch. 15).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from diagnosis.data_checks.candidates import build_candidates
from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.hypothesis_set import join_hypotheses
from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import compute_log_odds, select_material_sets
from diagnosis.levels.refit_laws import refit_laws
from diagnosis.null_model import Baseline, refit_from
from diagnosis.refits.measured import find_variance_source
from diagnosis.refits.refit import Refit, summarise_refit
from diagnosis.refits.refitting import (
    RefitTask,
    add_cause,
    add_hypothesis,
    find_start,
    run_refits,
)
from diagnosis.search.score_test import Score, scores, select_best_of_sites
from diagnosis.settings import DiagnosisSettings
from tuning import STAGES, Stage, is_gap_visible


@dataclass(frozen=True, eq=False)
class Search:
    """Result of the search.

    Args:
        null: null model.
        scores: score tests about the null model, the most promising first.
        refits: sets of causes in the order of their fits.
        selected: selected set of causes; the null model if no cause is probable.
    """

    null: Refit
    selected: Refit
    scores: tuple[Score, ...] = ()
    refits: tuple[Refit, ...] = ()

    @property
    def hypotheses(self) -> int:
        """Number of effects and places that were scored."""
        return len({score.hypothesis.site for score in self.scores})

    def refit_of(self, keys: Sequence[object]) -> Refit | None:
        """Return the best refit of a set of causes."""
        matching = [refit for refit in self.refits if set(refit.keys) == set(keys)]
        return min(matching, key=lambda refit: refit.objective, default=None)


def select_causes(
    base: Baseline, settings: DiagnosisSettings, say: Callable[[str], None]
) -> Search:
    """Select the causes that explain the gap of the null model.

    Args:
        base: null model, and what the data checks prove.
        settings: sizes of the search.
        say: called with the current step.
    """
    search, path, missed = Search(base.null, base.null), base.null, 0
    excluded = frozenset(hypothesis.location for hypothesis in base.proven)
    while len(path.causes) < settings.max_causes:
        say(f"score tests of all hypotheses for cause {len(path.causes) + 1}")
        ranked = score_hypotheses(base.scene, path, excluded, settings)
        say("refits of the most promising hypotheses")
        refits = _refit_round(base, path, ranked, settings)
        search = replace(
            search, scores=search.scores or tuple(ranked), refits=(*search.refits, *refits)
        )
        best = min(refits, key=lambda refit: refit.objective, default=None)
        if best is None:
            break
        if _is_accepted(search, best, search.selected, settings):
            search = _eliminate(base.scene, search, best, settings)
            has_grown = len(search.selected.causes) > len(path.causes)
            path, missed = search.selected, 0
            if not (has_grown and is_gap_visible(path.gap, settings.min_visible_excess)):
                break
        elif (
            search.selected.causes
            or missed == settings.max_improbable
            or not is_gap_visible(search.null.gap, settings.min_visible_excess)
        ):
            break
        else:  # with several effects, none may be probable before the others are in the set
            path, missed = best, missed + 1
    return search


def refit_null_model(base: Baseline, search: Search, settings: DiagnosisSettings) -> Search:
    """Refit the null model from the best set of causes, so that both have equal starts."""
    best = min(search.refits, key=lambda refit: refit.objective, default=None)
    if best is None:
        return search
    null = refit_from(base.scene, search.null, best, settings)
    return replace(search, null=null, selected=search.selected if search.selected.causes else null)


def score_hypotheses(
    scene: Scene, base: Refit, excluded: frozenset[str], settings: DiagnosisSettings
) -> list[Score]:
    """Score all hypotheses about a refit, the most promising first."""
    inner = move_scene(scene, base)
    sites = {cause.site for cause in base.causes}
    hypotheses = [
        hypothesis
        for effect in load_catalogue().values()
        for hypothesis in effect(inner)
        if hypothesis.location not in excluded and hypothesis.site not in sites
    ]
    return scores(inner, base.fit, hypotheses, base.floor, settings.score_stride)


def move_scene(scene: Scene, base: Refit) -> Scene:
    """Return the scene of a refit: further hypotheses are proposed about it."""
    return replace(scene, session=base.session, theta=base.fit.theta)


def _refit_round(
    base: Baseline,
    current: Refit,
    ranked: Sequence[Score],
    settings: DiagnosisSettings,
) -> list[Refit]:
    """Refit the promising hypotheses; where a rest remains, other starts and shapes of the best."""
    scene = base.scene
    promising = [score.hypothesis for score in select_best_of_sites(ranked)[: settings.max_refits]]
    laws = [hypothesis for hypothesis in promising if hypothesis.spring is not None]
    tasks = [add_cause(current, hypothesis) for hypothesis in promising if hypothesis not in laws]
    for hypothesis in _suggest_candidates(base, current, settings):
        tasks.append(add_cause(current, hypothesis, _first_stages(hypothesis, settings)))
    refits = run_refits(scene, tasks, settings.schedule)
    refits += refit_laws(scene, current, laws, base.null.gap, settings)
    best = min(refits, key=lambda refit: refit.objective, default=None)
    if best is None or not is_gap_visible(best.gap, settings.min_visible_excess):
        return refits
    cause = best.causes[-1]
    refitted = {refit.causes[-1] for refit in refits}
    further = [
        score.hypothesis
        for score in ranked
        if score.hypothesis.site == cause.site
        and score.hypothesis not in refitted
        and score.hypothesis.spring is None
    ]
    tasks = _distant_tasks(current, cause, settings)[: settings.max_distant]
    tasks += [add_cause(current, shape) for shape in _one_each_direction(further, settings)]
    return [*refits, *run_refits(scene, tasks, settings.schedule)]


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
    """Return the first stages of a fit whose start is a guess, as that of a body's mode."""
    return () if hypothesis.reform is None else _distant_stages(settings)[1:]


def _distant_stages(settings: DiagnosisSettings) -> tuple[Stage, ...]:
    """Return two stages with a logarithmic residual and large floors, for distant starts."""
    first, second = STAGES[1:3]
    return first, replace(second, stride=first.stride, max_steps=settings.max_distant_steps)


def _one_each_direction(
    hypotheses: Sequence[Hypothesis], settings: DiagnosisSettings
) -> list[Hypothesis]:
    """Return the best shape of each direction, then further shapes."""
    first: dict[str | None, Hypothesis] = {}
    for hypothesis in hypotheses:
        first.setdefault(hypothesis.dof, hypothesis)
    chosen = list(first.values())
    rest = [hypothesis for hypothesis in hypotheses if hypothesis not in chosen]
    return [*chosen, *rest][: settings.max_other_shapes]


def _distant_tasks(
    base: Refit, hypothesis: Hypothesis, settings: DiagnosisSettings
) -> list[RefitTask]:
    """Return refits from distant starts, where a strong effect may be found."""
    stages = _distant_stages(settings)
    return [
        add_cause(base, replace(hypothesis, begin={**hypothesis.begin, **start}), stages)
        for start in hypothesis.otherwise
    ]


def _eliminate(scene: Scene, search: Search, best: Refit, settings: DiagnosisSettings) -> Search:
    """Leave out each earlier cause in turn; drop it if the set without it is as probable."""
    # Parts of other causes refer to the coordinates of a body's mode, which therefore stays.
    removable = [cause for cause in best.causes[:-1] if cause.reform is None]
    tasks = []
    for left_out in removable:
        kept = join_hypotheses([cause for cause in best.causes if cause is not left_out])
        session = add_hypothesis(scene.session, kept)
        start = find_start(best, session, None)
        tasks.append(RefitTask(kept, session, start, best.floor))
    refits = run_refits(scene, tasks, settings.schedule)
    search = replace(search, refits=(*search.refits, *refits))
    for refit in refits:
        if not _is_more_probable(search, best, refit):
            best = refit
    return replace(search, selected=best)


def _is_accepted(search: Search, refit: Refit, base: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether a set with one more cause is material, and more probable."""
    sets = [summarise_refit(candidate) for candidate in (*search.refits, refit)]
    material = {
        fitted.keys for fitted in select_material_sets(summarise_refit(search.null), sets, settings)
    }
    return refit.keys in material and _is_more_probable(search, refit, base)


def _is_more_probable(search: Search, refit: Refit, base: Refit) -> bool:
    """Return whether the posterior prefers a set to another one."""
    sets = [summarise_refit(candidate) for candidate in (*search.refits, refit)]
    evidence = Evidence(
        null=summarise_refit(search.null),
        sets=tuple(sets),
        hypotheses=search.hypotheses,
        variance=find_variance_source(search.null.session.campaign),
    )
    first, second = compute_log_odds(
        evidence, [summarise_refit(refit), summarise_refit(base)], load_calibration()
    )
    return bool(first > second)
