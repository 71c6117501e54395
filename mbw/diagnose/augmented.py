"""Plants of ``mbw diagnose``: the MJCF with the established causes, and probable alternatives."""

from dataclasses import dataclass
from pathlib import Path

from diagnosis import Diagnosis
from diagnosis.estimates.held_out_gap import HeldOutGap
from diagnosis.estimates.intervals import FittedParameters, fit_parameters
from diagnosis.estimates.plant_posterior import estimate_plant_posterior
from diagnosis.inference.evidence import Key
from diagnosis.refits.refit import Refit
from mbmodel import WrittenModel, write_model
from mbw.results.diagnosed_files import ALTERNATIVES
from tuning import predict
from tuning.control_loops.loops_file import LOOPS_JSON, write_loops
from tuning.files.plant_folder import AlternativeRow, PlantRow, undetermined_doubts
from tuning.files.posterior_file import POSTERIOR_NPZ, write_posterior
from tuning.files.result import final_folder, not_held_error

_MIN_ALTERNATIVE_PROBABILITY = 0.05  # a 95 % interval may leave out what is less probable


@dataclass(frozen=True)
class WrittenAugmented:
    """The augmented MJCF.

    Args:
        written: what became of it.
        not_held_error: relative change of the FRFs without what it cannot hold; None if it holds
            all.
        plant: what the diagnosis says of it as a plant, and of alternatives.
    """

    written: WrittenModel
    not_held_error: float | None
    plant: PlantRow


def write_augmented(diagnosis: Diagnosis, target: Path) -> WrittenAugmented:
    """Write the tuned MJCF with the established causes, its posterior and the loops of the test.

    Alternatives that are probable are written beside it, each with its posterior.

    Args:
        target: the MJCF.
    """
    refit, gap = find_established_fit(diagnosis)
    is_after = gap is not None and gap is diagnosis.after
    fitted = diagnosis.parameters if is_after else None
    fitted = fitted or _describe_parameters(diagnosis, refit)
    write_loops(refit.session.model.machine.loops, target.with_name(LOOPS_JSON))
    written = _write_plant(refit, fitted, gap, target, target.with_name(POSTERIOR_NPZ))
    model, campaign = refit.session.model, refit.session.campaign
    stated = model.without_small_sizes(fitted.theta)
    error = not_held_error(model, stated, campaign) if written.not_held else None
    shares = find_alternatives(diagnosis, frozenset(refit.keys))
    rows = []
    for name, (keys, share) in zip(ALTERNATIVES[::2], shares[1:], strict=False):
        rival = diagnosis.search.refit_of(tuple(keys)) if keys else diagnosis.null
        if rival is not None:
            file = target.with_name(name)
            parameters = _describe_parameters(diagnosis, rival)
            _write_plant(rival, parameters, None, file, file.with_suffix(".npz"))
            rows.append(AlternativeRow(name=_name_causes(keys), probability=share, file=name))
    held_out = None if gap is None or gap.held_out is None else "after" if is_after else "retuned"
    plant = PlantRow(
        name=_name_causes(shares[0][0]),
        probability=shares[0][1],
        held_out=held_out,  # type: ignore[arg-type]
        doubts=_list_doubts(fitted),
        alternatives=rows,
    )
    return WrittenAugmented(written, error, plant)


def find_established_fit(diagnosis: Diagnosis) -> tuple[Refit, HeldOutGap | None]:
    """Return the refit with the established causes alone, and its held-out gap if it has one."""
    present = diagnosis.present
    fitted = {cause.key for cause in present.causes if cause not in diagnosis.gross_hypotheses}
    wanted = fitted & set(present.established)
    if wanted == fitted and diagnosis.after and diagnosis.parameters:
        return diagnosis.after.refit, diagnosis.after
    refit = diagnosis.search.refit_of(tuple(wanted)) if wanted else None
    return (diagnosis.retuned.refit, diagnosis.retuned) if refit is None else (refit, None)


def find_alternatives(
    diagnosis: Diagnosis, established: frozenset[Key]
) -> list[tuple[frozenset[Key], float]]:
    """Return the sets of causes that are plants, with their probabilities, of sum one.

    The established set comes first. Faults that redundant channels prove are no part of a plant.

    Args:
        diagnosis: diagnosis with its posterior.
        established: keys of the causes of augmented.xml.
    """
    posterior = diagnosis.posterior
    gross = {cause.key for cause in diagnosis.gross_hypotheses}
    shares: dict[frozenset[Key], float] = {frozenset(): posterior.none + posterior.unexplained}
    for keys, share in posterior.sets:
        causes = frozenset(keys) - gross
        shares[causes] = shares.get(causes, 0.0) + share
    held = frozenset(established) - gross
    first = shares.pop(held, 0.0)
    further = sorted(
        (row for row in shares.items() if row[1] >= _MIN_ALTERNATIVE_PROBABILITY),
        key=lambda row: -row[1],
    )[: len(ALTERNATIVES) // 2]
    total = first + sum(share for _, share in further)
    if not further or total <= 0:
        return [(held, 1.0)]
    return [(held, first / total), *((keys, share / total) for keys, share in further)]


def _describe_parameters(diagnosis: Diagnosis, refit: Refit) -> FittedParameters:
    """Return the parameters of a refit with their confidence, as the search left them."""
    factor = diagnosis.scene.stride_factor
    return fit_parameters(refit, factor, diagnosis.settings, is_final=False)


def _write_plant(
    refit: Refit,
    fitted: FittedParameters,
    gap: HeldOutGap | None,
    target: Path,
    posterior_file: Path,
) -> WrittenModel:
    """Write the MJCF of a fit, and its posterior."""
    session = refit.session
    model, campaign = session.model, session.campaign
    predicted = predict(model, fitted.theta, campaign) if gap is None else gap.predicted
    posterior = estimate_plant_posterior(session, fitted, fitted.fit or refit.fit, predicted)
    write_posterior(posterior, posterior_file)
    stated = model.without_small_sizes(fitted.theta)
    return write_model(model, stated, target, final_folder(target.parent))


def _name_causes(keys: frozenset[Key]) -> str:
    """Return the causes of a plant in words."""
    names = sorted(f"{effect}@{location}" for effect, location, _ in keys)
    return "+".join(names) or "no cause"


def _list_doubts(fitted: FittedParameters) -> list[str]:
    """Return the doubts about a fit: how it ended, and what the data do not determine.

    Sizes of causes have their intervals in the verdict, and some shape nothing, such as the place
    of an appendage along the direction in which it moves.
    """
    doubts = [] if fitted.converged else ["the fit of the sizes ran out of evaluations"]
    drawn = {
        p.name for p in fitted.parametrisation.parameters if p.known in ("stiffness", "damping")
    }
    unseen = fitted.confidence.unidentifiable_directions()
    names = [name for row in unseen for name in row.parameters if name in drawn]
    return [*doubts, *undetermined_doubts(names)]
