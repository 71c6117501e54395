"""A payload is diagnosed with a probability below one; its plant is predicted as an alternative.

The machine is the feed axis of matrices written by hand; tuning, diagnosis and prediction are those
of the command. The force channels are well calibrated, since masses have no scale without them. The
posterior counts few values as independent, so that a rival of the cause keeps some probability.
"""

import json
import re

import numpy as np
import pytest
from encoder_campaign import CHANNELS, REFERENCES, axis_frfs, write_encoder_campaign
from typer.testing import CliRunner

import mbworkbench as mb
from diagnosis.inference import posterior
from diagnosis.inference.calibration import load_calibration
from mbw.command import app

RUNNER = CliRunner()
SCALES, PAYLOAD = {"carriage_tx": 1.2}, 1.9  # kg
BAND = ("--band", 8, 160, "--lines", 120)
# Output and input of the MJCF, and their numbers among channels and references of the campaign.
PORTS = (
    ("acc2:+tx", "drive", CHANNELS.index("acc2:+x"), REFERENCES.index("drive")),
    ("carriage:+ry", "coil-magnet:+tx", CHANNELS.index("carriage:+ry"), 1),
    ("acc2:+tz", "hit1:+tz", CHANNELS.index("acc2:+z"), REFERENCES.index("hit1:+z")),
)


def mbw(*arguments):
    result = RUNNER.invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Tuning and diagnosis of a campaign with a payload that the model lacks."""
    place = tmp_path_factory.mktemp("payload")
    write_encoder_campaign(
        place / "case",
        scales=SCALES,
        added_mass=PAYLOAD,
        lines=60,
        extra="[tolerance]\nhammer_gain = 0.003\n",
    )
    mbw("tune", place / "case", "--out", place / "tuned", "--no-pictures", "-q")
    unsure = load_calibration().model_copy(update={"error_values": 1.2, "noise_exponent": 40.0})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior, "load_calibration", lambda: unsure)
        mbw("diagnose", place / "case", "--out", place / "diagnosed", "--jobs", 1)
    return place


def test_a_diagnosed_cause_is_an_alternative_plant_with_its_probability(folder, tmp_path):
    verdict = json.loads((folder / "diagnosed" / "verdict.json").read_text(encoding="utf-8"))
    cause = verdict["causes"][0]
    assert (cause["effect"], cause["location"]) == ("mass_error", "body:carriage")
    assert 0.5 < cause["probability"] < 0.99
    augmented = mb.read_model(folder / "diagnosed" / "augmented.xml")
    for output, reference, row, column in PORTS:
        command = ["predict", folder / "tuned", "--bands", "--diagnosed", folder / "diagnosed"]
        command += ["--output", output, "--input", reference, *BAND, "--no-pictures"]
        out = tmp_path / output.replace(":", "")
        said = mbw(*command, "--out", out).stderr
        with np.load(out / "bands.npz") as file:
            bands = dict(file)
        probability = bands["weights"][1]
        assert probability == pytest.approx(cause["probability"], abs=1e-9)
        assert bands["weights"].sum() == pytest.approx(1.0)
        assert f"mass_error@body:carriage ({100 * probability:.3g} %)" in said
        rival = verdict["causes"][1]
        stands = rf"{rival['effect']}@{rival['location']} \({100 * rival['probability']:.3g}"
        assert re.search(rf"the tuned plant stands for {stands}", said)
        assert "too, whose own plant is not computed" in said
        assert "encoder.gain" not in said  # no part of a plant

        # the alternatives are the plants of both files
        freq = bands["freq_hz"]
        with_cause = augmented.frf(output, reference, freq, "accelerance").values
        np.testing.assert_allclose(bands["alternative_frf"][1], with_cause, rtol=1e-7)
        np.testing.assert_allclose(bands["alternative_frf"][0], bands["frf"], rtol=1e-12)

        # the true machine is the one with the cause, and within the interval over both
        size = np.abs(axis_frfs(freq, SCALES, added_mass=PAYLOAD)[:, row, column])
        errors = [
            np.median(np.abs(np.abs(plant[:, 0, 0]) / size - 1))
            for plant in bands["alternative_frf"]
        ]
        assert errors[0] > 0.03
        assert errors[1] < 0.003
        inside = (bands["low"][:, 0, 0] <= size) & (size <= bands["high"][:, 0, 0])
        assert inside.mean() > 0.95


def test_the_interval_over_both_plants_is_wider_than_that_of_the_tuned_one(folder, tmp_path):
    ports = ["--output", "acc2:+tx", "--input", "drive", *BAND, "--no-pictures"]
    widths = {}
    for name, option in (("one", []), ("both", ["--diagnosed", folder / "diagnosed"])):
        mbw("predict", folder / "tuned", "--bands", *ports, *option, "--out", tmp_path / name)
        with np.load(tmp_path / name / "bands.npz") as file:
            widths[name] = np.median((file["high"] - file["low"]) / np.abs(file["frf"]))
    assert widths["both"] > 1.5 * widths["one"]
