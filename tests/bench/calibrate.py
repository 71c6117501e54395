"""Constants of the posterior, by maximum likelihood on campaigns that no reported figure uses.

Each kept row holds the evidence of one virtual machine and its truth (``calibration_rows``): real
instruments, 0, 5, 15 and 30 % of small errors beside one effect, several or none. Of each the
logarithm of the probability of the truth counts: that of every effect that is present (geometric
mean of several), of no cause where nothing is missing, and of no cause or of a small error that is
named where small errors are alone. ``error_values`` is fitted on a grid; where the likelihood is
flat, the least sure value counts. ``hidden``, its width and ``force_scale``
are those that earlier series of campaigns gave (seeds 80000 to 320673), but for ``hidden.lines``:
four times the largest gap of exact machines among campaigns of seeds 390000 to 391062.

``python -m tests.bench.calibrate`` writes the maximum to ``diagnosis/inference/calibration.json``.
"""

import gzip
import hashlib
import json
from functools import cache
from pathlib import Path

import numpy as np

from diagnosis.inference.calibration import Calibration, load_calibration
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import Posterior, compute_posterior, read_site

ROWS = Path(__file__).parent / "results" / "calibrate.430000.json.gz"
FILE = Path(__file__).parents[2] / "diagnosis" / "inference" / "calibration.json"
ERROR_VALUES = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 256)
MIN_TRUTH_PROBABILITY = 0.01  # that a campaign counts at least: one outlier rules nothing
FLAT_NATS = 0.1  # of all campaigns together: no difference
COMMAND = "python -m tests.bench.calibrate"


def run() -> list[dict[str, object]]:
    """Return how probable the committed constants find the truth."""
    nats = [-log_probability(row, load_calibration()) for row in read_rows()]
    return [{"figure": "nats a campaign", "value": float(np.mean(nats)), "n": len(nats)}]


@cache
def read_rows() -> tuple[dict, ...]:
    """Return the kept rows: truth, small errors and evidence."""
    return tuple(json.loads(gzip.decompress(ROWS.read_bytes())))


def fit_constants() -> Calibration:
    """Return the least sure constants of about the largest likelihood, and where they come from."""
    start = load_calibration()
    candidates = [
        start.model_copy(update={"error_values": float(values)}) for values in ERROR_VALUES
    ]
    likelihoods = [log_likelihood(candidate) for candidate in candidates]
    equal = [
        candidate
        for candidate, likelihood in zip(candidates, likelihoods, strict=True)
        if likelihood > max(likelihoods) - FLAT_NATS
    ]
    best = min(equal, key=lambda candidate: candidate.error_values)
    seeds = sorted(row["seed"] for row in read_rows())
    return best.model_copy(
        update={
            "campaigns": len(seeds),
            "command": COMMAND,
            "seeds": f"{seeds[0]} to {seeds[-1]}",
            "evidence": hashlib.sha256(gzip.decompress(ROWS.read_bytes())).hexdigest(),
        }
    )


def log_likelihood(constants: Calibration) -> float:
    """Return the sum of all campaigns [nats]."""
    return sum(log_probability(row, constants) for row in read_rows())


def log_probability(row: dict, constants: Calibration) -> float:
    """Return the logarithm of the probability of a campaign's truth."""
    posterior = compute_posterior(Evidence.model_validate(row["evidence"]), constants)
    probability = truth_probability(row, posterior)
    return float(np.log(min(1.0, max(probability, MIN_TRUTH_PROBABILITY))))


def truth_probability(row: dict, posterior: Posterior) -> float:
    """Return the probability of what is true."""
    present = {read_site(key): probability for key, probability in posterior.causes}
    truth = [tuple(site) for site in row["truth"]]
    if truth:
        shares = [max(present.get(site, 0.0), MIN_TRUTH_PROBABILITY) for site in truth]
        return float(np.prod(shares) ** (1 / len(shares)))
    if not row["items"]:
        return posterior.none
    items = {tuple(site) for site in row["items"]}
    named = [probability for site, probability in present.items() if site in items]
    return posterior.none + posterior.unexplained + max(named, default=0.0)


if __name__ == "__main__":
    FILE.write_text(fit_constants().model_dump_json(indent=1) + "\n", encoding="utf-8")
