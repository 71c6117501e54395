"""Each rule of the posterior turned off in turn, on the evidence that calibrates its constants.

The fits stay; the posterior weighs them again without the rule. The rate is how often it gives an
entirely right verdict a probability of one half or more: all effects that are present, and beside
them nothing but small errors of that machine (``calibrate.truth_probability``). The difference from
all rules is that of the same campaigns, with Newcombe's interval for paired proportions. Rungs of
the search need new fits: ``ablation`` turns them off.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.inference.calibration import Calibration, load_calibration
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import compute_posterior
from diagnosis.settings import SETTINGS, DiagnosisSettings
from identification.words import Real
from tests.bench.calibrate import MIN_TRUTH_PROBABILITY, read_rows, truth_probability
from truth.grade.rates import paired_difference, wilson


def _keep(evidence: Evidence) -> Evidence:
    return evidence


@dataclass(frozen=True)
class Rules:
    """Rules by which evidence is weighed.

    Args:
        constants: changed constants.
        settings: thresholds.
        change: returns evidence to which a rule does not apply.
    """

    constants: dict[str, float] = field(default_factory=dict)
    settings: DiagnosisSettings = SETTINGS
    change: Callable[[Evidence], Evidence] = _keep

    def calibrate(self) -> Calibration:
        """Return the constants."""
        return load_calibration().model_copy(update=self.constants)


def _change_sets(**numbers: object) -> Callable[[Evidence], Evidence]:
    """Return a change of all fits, the null model's too."""

    def change(evidence: Evidence) -> Evidence:
        sets = tuple(fitted.model_copy(update=numbers) for fitted in evidence.sets)
        null = evidence.null.model_copy(update=numbers)
        return evidence.model_copy(update={"sets": sets, "null": null})

    return change


def _change(**numbers: object) -> Callable[[Evidence], Evidence]:
    return lambda evidence: evidence.model_copy(update=numbers)


def _double_parameters(evidence: Evidence) -> Evidence:
    sets = tuple(
        fitted.model_copy(update={"parameters": tuple(2 * count for count in fitted.parameters)})
        for fitted in evidence.sets
    )
    return evidence.model_copy(update={"sets": sets})


def _keep_single_causes(evidence: Evidence) -> Evidence:
    sets = tuple(fitted for fitted in evidence.sets if len(fitted.keys) == 1)
    return evidence.model_copy(update={"sets": sets})


RULES = {
    "all rules": Rules(),
    "parameters are free of charge": Rules(change=_change_sets(parameters=())),
    "parameters pay a nat each": Rules(change=_double_parameters),
    "hypotheses are free of charge": Rules(change=_change(hypotheses=1)),
    "tolerances are free of charge": Rules(change=_change_sets(prior=0.0)),
    "noise counts by its share": Rules({"noise_exponent": 1.0}),
    "model errors are as independent as noise": Rules({"error_values": 50_000.0}),
    "model errors are one value": Rules({"error_values": 1.0}),
    "no materiality": Rules(settings=replace(SETTINGS, min_closed=0.0)),
    "outliers of tolerances are causes": Rules(settings=replace(SETTINGS, outlier_sigma=0.0)),
    "proven faults pay like others": Rules(change=_change(small_faults=())),
    "one cause at most": Rules(change=_keep_single_causes),
}


def run() -> list[dict[str, object]]:
    """Return rate and nats of all rules, and without each; and the difference of the rates."""
    probabilities = {name: weigh_rows(rules) for name, rules in RULES.items()}
    base = probabilities["all rules"]
    figures: list[dict[str, object]] = []
    for name, stated in probabilities.items():
        right, count = stated >= SETTINGS.min_probability, len(stated)
        low, high = wilson(int(right.sum()), count)
        interval = f"{count} [{100 * low:.1f}, {100 * high:.1f}]"
        nats = -np.log(np.maximum(stated, MIN_TRUTH_PROBABILITY)).mean()
        figures.append({"figure": f"{name}: right, %", "value": 100 * right.mean(), "n": interval})
        figures.append({"figure": f"{name}: nats a campaign", "value": nats, "n": count})
        if name != "all rules":
            pairs = paired_difference(zip(right, base >= SETTINGS.min_probability, strict=True))
            figures.append(
                {
                    "figure": f"{name}: difference, %",
                    "value": 100 * pairs.difference,
                    "n": f"{count} [{100 * pairs.low:.1f}, {100 * pairs.high:.1f}]",
                }
            )
    return figures


def weigh_rows(rules: Rules) -> Real:
    """Return the probability that some rules give the truth of each campaign; (n_campaign,)."""
    constants = rules.calibrate()
    stated = []
    for row in read_rows():
        evidence = rules.change(Evidence.model_validate(row["evidence"]))
        stated.append(
            truth_probability(row, compute_posterior(evidence, constants, rules.settings))
        )
    return np.minimum(stated, 1.0)
