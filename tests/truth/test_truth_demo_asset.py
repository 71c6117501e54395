"""The built-in campaigns are what ``make demo-campaign`` and ``make two-bodies`` make."""

import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import pyuff

from truth import Cause, Plan, Protocol, Wanted, draw_campaign, read_station, write_campaign

ASSETS = Path(__file__).resolve().parents[2] / "assets"
MAKEFILE = ASSETS.parent / "Makefile"


@pytest.mark.parametrize("name", ["demo", "two_bodies"])
def test_a_built_in_campaign_comes_from_its_seed_and_nominal_machine(name, tmp_path):
    lines = [text for text in MAKEFILE.read_text().splitlines() if "-m truth" in text]
    (words,) = (line.split() for line in lines if f"assets/{name}" in line.split())
    options = dict(pairwise(words))
    station = read_station(ASSETS.parent / options["truth"])
    wanted = Wanted(options["--effect"], options.get("--place"), float(options["--ratio"]))
    protocol = Protocol((int(options["--node"]),))
    plan = Plan(int(options["--seed"]), Cause((wanted,)), protocol)
    write_campaign(draw_campaign(station, plan), tmp_path / name)
    for file in ("answer.toml", "campaign.toml"):
        drawn = tomllib.loads((tmp_path / name / file).read_text())
        committed = tomllib.loads((ASSETS / name / file).read_text())
        assert drawn.keys() == committed.keys()
        assert drawn.get("effect") == committed.get("effect")
        for key, value in drawn.get("parameters", {}).items():
            assert committed["parameters"][key] == pytest.approx(value, rel=1e-9)
    for mesh in (tmp_path / name).glob("meshes/*"):
        assert mesh.read_bytes() == (ASSETS / name / "meshes" / mesh.name).read_bytes()
    (uff,) = (ASSETS / name).glob("*.uff")
    drawn, committed = (
        pyuff.UFF(str(folder / uff.name)).read_sets([3, 50, 70])
        for folder in (tmp_path / name, ASSETS / name)
    )
    for first, second in zip(drawn, committed, strict=True):
        # Single precision on another machine's arithmetic.
        np.testing.assert_allclose(first["data"], second["data"], rtol=1e-5, atol=1e-12)
