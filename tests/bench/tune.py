"""How near the noise a tuning comes where no effect is present, and what tolerances are for.

The seeds are reported only: whatever was chosen in the fit was chosen on others.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
from rich.progress import track

from identification.words import Complex
from truth import Plan, draw_campaign, read_station, write_campaign
from tuning import (
    Session,
    channel_gaps,
    fit,
    fit_held_out,
    open_session,
    predict,
    summarise_gaps,
)
from tuning.assessment.parameter_confidence import rank_pulls
from tuning.campaign_tuning import refit_without_bounds

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "campaigns" / "open" / "none"
SEEDS = range(9001, 9006)


def run() -> list[dict[str, object]]:
    """Campaigns without any effect: five of our own, and the open one if it is there."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folders = {}
        station = read_station(ROOT / "assets" / "microstation" / "station.xml")
        for seed in SEEDS:
            folder = Path(name) / f"seed{seed}"
            write_campaign(draw_campaign(station, Plan(seed)), folder)
            folders[f"truth, seed {seed}"] = folder
        if SHARED.exists():
            folders["open/none"] = SHARED
        for label, folder in track(folders.items(), description="campaigns"):
            rows.append({"campaign": label, **_tune(open_session(folder))})
    return rows


def _tune(session: Session) -> dict[str, object]:
    """Excess is the root mean square over channels of error / noise: 1 is a perfect model."""
    model, campaign, varies = session.model, session.campaign, session.parametrisation
    nothing = varies.coordinates(model.drawn)
    alone = fit(model, campaign, parametrisation=varies.restrict(~varies.is_tolerance, nothing))
    start = time.process_time()
    found = fit(model, campaign, parametrisation=varies)
    seconds = time.process_time() - start
    free = refit_without_bounds(model, campaign, found)
    held_out = fit_held_out(model, found, campaign)
    name, largest = rank_pulls(free.parametrisation, free.x)[0]
    as_drawn = predict(model, model.drawn, campaign)
    return {
        "noise": summarise_gaps(channel_gaps(as_drawn, campaign)).noise,
        "excess as drawn": _excess(session, as_drawn),
        "stiffness and damping alone": _excess(session, predict(model, alone.theta, campaign)),
        "tolerances too": _excess(session, predict(model, found.theta, campaign)),
        "held out": held_out and _excess(session, held_out.predict(model, campaign)),
        "largest pull without bounds": largest,
        "of": name,
        "core s": seconds,
        "evaluations": found.evaluations,
        "parameters": int(np.size(found.x)),
    }


def _excess(session: Session, predicted: tuple[Complex, ...]) -> float | None:
    return summarise_gaps(channel_gaps(predicted, session.campaign)).excess
