"""The built-in campaign is what ``make demo-campaign`` makes."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import pyuff

from truth import Cause, Plan, Protocol, Wanted, draw_campaign, read_station, write_campaign

ASSETS = Path(__file__).resolve().parents[2] / "assets"
MAKEFILE = ASSETS.parent / "Makefile"


def test_the_demo_campaign_comes_from_its_seed_and_station(tmp_path):
    (line,) = (text for text in MAKEFILE.read_text().splitlines() if "-m truth" in text)
    words = line.split()
    seed, effect = words[words.index("--seed") + 1], words[words.index("--effect") + 1]
    node = int(words[words.index("--node") + 1])
    station = read_station(ASSETS.parent / words[words.index("truth") + 1])
    ratio = float(words[words.index("--ratio") + 1])
    plan = Plan(int(seed), Cause((Wanted(effect, None, ratio),)), Protocol((node,)))
    write_campaign(draw_campaign(station, plan), tmp_path / "demo")
    for name in ("answer.toml", "campaign.toml"):
        made = tomllib.loads((tmp_path / "demo" / name).read_text())
        kept = tomllib.loads((ASSETS / "demo" / name).read_text())
        assert made.keys() == kept.keys()
        assert made.get("effect") == kept.get("effect")
        for key, value in made.get("parameters", {}).items():
            assert kept["parameters"][key] == pytest.approx(value, rel=1e-9)
    for mesh in (tmp_path / "demo" / "meshes").iterdir():
        assert mesh.read_bytes() == (ASSETS / "demo" / "meshes" / mesh.name).read_bytes()
    (uff,) = (ASSETS / "demo").glob("*.uff")
    made, kept = (
        pyuff.UFF(str(folder / uff.name)).read_sets([3, 100, 300])
        for folder in (tmp_path / "demo", ASSETS / "demo")
    )
    for one, other in zip(made, kept, strict=True):
        # Single precision on another machine's arithmetic.
        np.testing.assert_allclose(one["data"], other["data"], rtol=1e-5, atol=1e-12)
