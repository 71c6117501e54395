"""Evidence of the calibration: campaigns that no reported figure uses, diagnosed one by one.

The designs are those of the reported campaigns (``scorecard_draws``) with other seeds: the first
designs from 430000 and from 540000 on, the latter with exact machines of the catalogue, and further
ones that have nothing but small errors from 431000 on. Force channels are left out.

``python -m tests.bench.calibration_rows`` goes on from where it was, then packs the rows for
``calibrate``. ``CAMPAIGNS`` and ``JOBS`` as in ``scorecard``.
"""

import gzip
import json
import os
import tomllib

from threadpoolctl import threadpool_limits

from diagnosis import diagnose
from tests.bench.calibrate import ROWS
from tests.bench.kept import cases
from tests.bench.scorecard import LEAST_RATIO
from tests.bench.scorecard_draws import Stored, ensure, reported_designs
from tuning import open_session

DIRTY = (
    "dirt 5 %",
    "dirt 15 %",
    "dirt 30 %",
    "dirt alone",
    "2 effects",
    "3 effects",
    "nothing",
)
SERIES = {  # first seed: designs from which campaigns are chosen, and their cells
    430_000: (48, DIRTY),
    431_000: (120, ("dirt alone",)),
    540_000: (127, (*DIRTY, "clean")),
}


def seeds() -> list[int]:
    """Return the seeds of all campaigns."""
    designs = reported_designs()
    return [
        first + n
        for first, (count, cells) in SERIES.items()
        for n in range(count)
        if designs[n].cell in cells
    ]


def make(seed: int) -> dict[str, object]:
    """Return truth, small errors and evidence of a campaign; no evidence if none can be judged."""
    first = max(first for first in SERIES if first <= seed)
    stored = ensure(reported_designs()[seed - first], seed)
    ratio = stored.weakest_ratio
    if stored.answer is None or (ratio is not None and ratio < LEAST_RATIO):
        return {"seed": seed}
    return {"seed": seed, **describe_truth(stored), "evidence": _evidence(stored)}


def describe_truth(stored: Stored) -> dict[str, object]:
    """Return effects with their places, and those of all small errors."""
    truth = tomllib.loads(stored.answer or "")
    causes = [cause for cause in truth.get("cause", [truth]) if cause["effect"] != "none"]
    return {
        "truth": [[cause["effect"], cause["location"]] for cause in causes],
        "items": [item.split("@") for item in stored.dirt_items],
    }


def _evidence(stored: Stored) -> dict[str, object]:
    with threadpool_limits(1):
        return diagnose(open_session(stored.folder)).evidence.model_dump(mode="json")


if __name__ == "__main__":
    made, file = cases("calibrate", seeds(), make, int(os.environ.get("JOBS", "2")))
    whole = [row for row in made if "evidence" in row]
    ROWS.write_bytes(gzip.compress(json.dumps(whole).encode(), mtime=0))
    file.unlink()
