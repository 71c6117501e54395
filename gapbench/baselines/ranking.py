r"""Two baselines of the trade: a refit alone, and a ranking by COMAC, FRAC and residual share.

The excess of the refit says whether something is missing. Each sensor is ranked by its COMAC, by
the worst FRAC and by the largest residual share of its channels; its rank is the mean of the three.
The sensor itself is blamed if its residual is far larger than any other sensor's, the force channel
if measured FRFs are those of the model times one factor, else the body with the worst mean rank.
"""

from collections import defaultdict

import numpy as np

from gapbench.baselines.refit import CampaignRefit
from identification.words import Real
from truth.grade.compare import channel_measures, channel_sums, comac

EXCESS_OF_EVEN_ODDS, ODDS_EXPONENT = 1.12, 40.0  # odds of a gap: (excess / 1.12)^40
CONFIDENCE = 0.2  # probability of what is blamed, if there is a gap
STANDS_OUT = 4.0  # residual of a sensor over that of the next one
FACTOR_SHARE = 0.5  # part of the residual's power that one factor of all FRFs takes away


def gap_probability(excess: float) -> float:
    """Return the probability that a refit with this excess left more than noise."""
    return float(1 / (1 + (excess / EXCESS_OF_EVEN_ODDS) ** -ODDS_EXPONENT))


def refit_only(fitted: CampaignRefit) -> dict[str, object]:
    """Return the answer of a refit that knows no effect."""
    gap = gap_probability(fitted.excess)
    return {"none": 1 - gap, "unexplained": gap}


def ranking(fitted: CampaignRefit) -> dict[str, object]:
    """Return the answer that blames what agrees worst."""
    gap = gap_probability(fitted.excess)
    sums: dict[str, list[Real]] = defaultdict(list)
    for each in fitted.tests:
        outputs = each.test.estimate.frf.outputs
        measured = each.model + each.left
        parts = channel_sums(measured, each.model)
        for k in np.flatnonzero(each.moves).tolist():
            sums[str(outputs[k]).partition(":")[0]].append(parts[:, k])
    sites = list(sums)
    comacs = [comac(np.sum(sums[site], axis=0)[[0, 1, 4]]) for site in sites]
    fracs = [min(channel_measures(part)[0] for part in sums[site]) for site in sites]
    shares = np.array([max(channel_measures(part)[1] for part in sums[site]) for site in sites])
    ranks = np.mean([np.argsort(np.argsort(v)) for v in (comacs, fracs, -shares)], axis=0)
    worst = sites[int(np.argmin(ranks))]
    most, second = np.sort(shares)[::-1][:2]
    factor, taken = _common_factor(fitted)
    layout = fitted.session.campaign.layout
    body_of = {site: layout.bodies[layout.body_of[layout.points.index(site)]] for site in sites}
    if taken > FACTOR_SHARE:
        reference = fitted.tests[0].test.condition.reference
        cause = {"effect": "hammer_gain", "places": [f"hammer:{reference.point}"], "size": factor}
    elif most > STANDS_OUT * second and sites[int(np.argmax(shares))] == worst:
        cause = {"effect": "sensor_gain", "places": [f"sensor:{worst}"]}
    else:
        of_body = {
            body: np.mean(
                [rank for rank, site in zip(ranks, sites, strict=True) if body_of[site] == body]
            )
            for body in set(body_of.values())
        }
        cause = {
            "effect": "mass_error",
            "places": [f"body:{min(of_body, key=of_body.__getitem__)}"],
        }
    return {
        "none": 1 - gap,
        "unexplained": gap * (1 - CONFIDENCE) * 0.5,
        "sets": [{"probability": gap * (1 + CONFIDENCE) * 0.5, "causes": [cause]}],
    }


def _common_factor(fitted: CampaignRefit) -> tuple[float, float]:
    """Return the factor between measured FRFs and the model's, and what it takes of the residual.

    Every value counts by its noise.
    """
    cross = square = power = 0.0
    for each in fitted.tests:
        weight = each.moves / np.maximum(each.variance, 1e-300)
        cross += float((weight * (each.left * each.model.conj()).real).sum())
        square += float((weight * np.abs(each.model) ** 2).sum())
        power += float((weight * np.abs(each.left) ** 2).sum())
    return 1 + cross / square, cross**2 / (square * power)
