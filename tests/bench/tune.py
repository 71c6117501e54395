"""Tuning stiffness and damping alone: how near the noise, and how many starts agree.

The seeds are reported only: whatever was chosen in the fit was chosen on others.
"""

import tempfile
from pathlib import Path

from rich.progress import track

from truth import Plan, draw_campaign, read_station, write_campaign
from tuning import channel_gaps, fit, fit_held_out, open_session, predict, random_starts, summarise

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "campaigns" / "open" / "none"
SEEDS = range(9001, 9006)
STARTS = 4


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
            rows.append({"campaign": label, **_tune(folder)})
    return rows


def _tune(folder: Path) -> dict[str, object]:
    session = open_session(folder)
    model, campaign = session.model, session.campaign
    found = fit(model, campaign, starts=random_starts(model, STARTS, seed=0))
    held_out = fit_held_out(model, found.theta, campaign)
    gaps = [
        summarise(channel_gaps(answers, campaign))
        for answers in (
            predict(model, model.drawn, campaign),
            predict(model, found.theta, campaign),
            held_out.predict(model, campaign),
        )
    ]
    noise = gaps[0].noise
    return {
        "noise": noise,
        "as drawn / noise": gaps[0].error / noise,
        "tuned / noise": gaps[1].error / noise,
        "held out / noise": gaps[2].error / noise,
        "starts agreeing": f"{found.agree} of {STARTS}",
        "evaluations": found.evaluations,
        "worst / best cost": max(found.costs) / min(found.costs),
    }
