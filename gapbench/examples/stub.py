"""The smallest entry in Python: it reads a campaign and says that something is missing."""

import json
import sys
import tomllib
from pathlib import Path

folder = Path(sys.argv[1])
campaign = tomllib.loads((folder / "campaign.toml").read_text(encoding="utf-8"))
sites = [line for line in (folder / campaign["model"]).read_text().splitlines() if "<body" in line]
body = sites[-1].split('name="')[1].split('"')[0]
answer = {
    "format": 1,
    "none": 0.2,
    "unexplained": 0.5,
    "sets": [
        {"probability": 0.3, "causes": [{"effect": "mass_error", "places": [f"body:{body}"]}]}
    ],
}
sys.stdout.write(json.dumps(answer))
