"""Exchanged channels: a sentence of their own in the remarks of ``mbw identify``."""

import json

import scipy.io
from campaign_folder import write_folder
from typer.testing import CliRunner

from identification import exchange_phrase
from mbw.command import app


def test_exchanges_are_told_in_words():
    assert exchange_phrase("sensor:acc1", "tx+ty") == "channels tx and ty of acc1 are exchanged"
    assert exchange_phrase("sensor:a+b", None) == "sensors a and b are exchanged"


def test_exchanged_sensors_have_a_line_of_their_own(tmp_path):
    campaign = write_folder(tmp_path / "campaign", noise=0.002, lines=400)
    content = scipy.io.loadmat(campaign / "impact.mat")
    for name in ("FRFs", "COHs"):
        content[name] = content[name][[*range(15, 18), *range(3, 15), *range(3)]]
    kept = {name: value for name, value in content.items() if not name.startswith("__")}
    scipy.io.savemat(campaign / "impact.mat", kept)
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["identify", str(campaign), "--out", str(out)])
    assert done.exit_code == 0, done.stderr
    solid = json.loads((out / "modes.json").read_text())["solid"]
    effects = {fault["effect"] for row in solid for fault in row["faults"]}
    assert effects == {"sensor_swap"}, done.stderr
    (line,) = [
        text for text in done.stderr.splitlines() if text.startswith("Sensors acc1 and acc6 are")
    ]
    assert line.endswith("exchange their cables or their labels.")
    assert "move against their body" not in done.stderr
    assert line.split(" (")[0] in (out / "identify.html").read_text()
