"""A payload is diagnosed with a probability below one; its plant is predicted as an alternative.

The machine is the feed axis of matrices written by hand; tuning, diagnosis and prediction are those
of the command. The force channels are well calibrated, since masses have no scale without them. The
posterior counts few values as independent, so that a rival of the cause keeps some probability.
"""

import json
import re
import shutil

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
BUDGET = """
band = [8.0, 160.0]

[error.x]
output = "acc2:+tx"

[disturbance.force]
input = "drive"
density = 1.0
unit = "1/sqrt(Hz)"
"""


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
    unsure = load_calibration().model_copy(update={"error_values": 0.9, "noise_exponent": 40.0})
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
        for rival in verdict["causes"][1:2]:
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


def test_the_folder_of_a_diagnosis_is_a_plant_with_its_alternatives(folder, tmp_path):
    row = json.loads((folder / "diagnosed" / "diagnosis.json").read_text(encoding="utf-8"))["plant"]
    files = ["augmented.xml", *(each["file"] for each in row["alternatives"])]
    assert len(files) > 1
    output, reference, number, column = PORTS[0]
    command = ["predict", folder / "diagnosed", "--bands", "--output", output]
    command += ["--input", reference, "--uncertain", tmp_path / "plant.npz", "--weight", 3, *BAND]
    mbw(*command, "--out", tmp_path, "--no-pictures")
    with np.load(tmp_path / "bands.npz") as file:
        bands = dict(file)
    freq = bands["freq_hz"]
    assert bands["alternatives"].tolist() == ["mass_error@body:carriage", "no cause"]
    assert bands["weights"] == pytest.approx(
        [row["probability"], *(each["probability"] for each in row["alternatives"])]
    )
    for name, found in zip(files, bands["alternative_frf"], strict=True):
        model = mb.read_model(folder / "diagnosed" / name)
        expected = model.frf(output, reference, freq, "accelerance").values
        np.testing.assert_allclose(found, expected, rtol=1e-7)
    size = np.abs(axis_frfs(freq, SCALES, added_mass=PAYLOAD)[:, number, column])
    inside = (bands["low"][:, 0, 0] <= size) & (size <= bands["high"][:, 0, 0])
    assert inside.mean() > 0.95
    with np.load(tmp_path / "plant.npz") as file:
        assert "carriage.added_mass_1" in file["blocks"].tolist()
        assert file["error"] < 0.05
    assert (tmp_path / "weight.npz").is_file()


def test_python_reads_the_plant_of_a_diagnosis_with_what_it_does_not_know(folder):
    freq = np.linspace(8.0, 160.0, 60)
    for output, reference, number, column in PORTS:
        size = np.abs(axis_frfs(freq, SCALES, added_mass=PAYLOAD)[:, number, column])
        plant = mb.read_plant(folder / "diagnosed", output, reference, freq)
        low, high = (end[:, 0, 0] for end in plant.bands().magnitude_interval())
        assert ((low <= size) & (size <= high)).mean() > 0.95
        assert np.median((high - low) / size) < 0.2
    tuned = mb.read_plant(folder / "tuned", output, reference, freq)
    assert {*plant.posterior.posterior.names} - {*tuned.posterior.posterior.names} == {
        *("carriage.added_mass_1", "carriage.added_mass_2", "carriage.added_mass_3"),
        "carriage.added_inertia_yy",
    }
    sizes = plant.posterior.sample(200, 0) @ np.isin(
        [parameter.name for parameter in plant.posterior.model.parameters],
        [f"carriage.added_mass_{k}" for k in (1, 2, 3)],
    )
    cause = json.loads((folder / "diagnosed" / "verdict.json").read_text(encoding="utf-8"))
    low, high = cause["causes"][0]["interval"]["mass"]
    unit = 0.16  # kg of a parameter: a hundredth of the carriage
    assert 1.96 * unit * sizes.std() == pytest.approx((high - low) / 2, rel=0.5)


def test_a_budget_on_a_diagnosis_has_an_interval(folder, tmp_path):
    (tmp_path / "budget.toml").write_text(BUDGET, encoding="utf-8")
    command = ["predict", folder / "diagnosed", "--budget", tmp_path / "budget.toml"]
    mbw(*command, "--out", tmp_path, "--json", tmp_path / "p.json")
    budget = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))["budget"]
    (error,) = budget["errors"]
    assert error["low"] < error["rms"] < error["high"]
    in_python = mb.error_budget(folder / "diagnosed", tmp_path / "budget.toml")
    assert in_python.interval["x"] == pytest.approx((error["low"], error["high"]))


def test_doubts_about_a_fit_stand_first_in_all_that_is_made_from_it(folder, tmp_path):
    copy = tmp_path / "diagnosed"
    shutil.copytree(folder / "diagnosed", copy)
    content = json.loads((copy / "verdict.json").read_text(encoding="utf-8"))
    content["verdict"] = "partly"
    (copy / "verdict.json").write_text(json.dumps(content), encoding="utf-8")
    shown = json.loads((copy / "diagnosis.json").read_text(encoding="utf-8"))
    shown["plant"]["doubts"] = ["the data do not determine frame_ry.damping"]
    (copy / "diagnosis.json").write_text(json.dumps(shown), encoding="utf-8")
    (tmp_path / "budget.toml").write_text(BUDGET, encoding="utf-8")
    command = ["predict", copy, "--budget", tmp_path / "budget.toml", "--out", tmp_path / "out"]
    said = mbw(*command, "--json", tmp_path / "p.json").stderr.splitlines()
    first = "In doubt by verdict.json: something is missing beside the established causes"
    second = "In doubt by verdict.json: the data do not determine frame_ry.damping."
    assert said[0].startswith(first)
    assert said[1] == second
    content = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    assert list(content)[:2] == ["format", "doubts"]
    assert content["doubts"][0].startswith(first)
    for page in ("predict.html", "plant.html"):
        text = (tmp_path / "out" / page).read_text(encoding="utf-8")
        assert 0 < text.index(first) < text.index(second) < text.index("<h2>")
    for result in (
        mb.read_plant(copy, "acc2:+tx", "drive", np.linspace(8.0, 160.0, 5)),
        mb.error_budget(copy, tmp_path / "budget.toml"),
    ):
        assert repr(result).startswith(first)
    tuned = json.loads((folder / "tuned" / "tuned.json").read_text(encoding="utf-8"))
    assert tuned["fit"]["doubts"]
    said = mbw("predict", folder / "tuned", "--modes", "--no-pictures").stderr
    assert said.startswith(f"In doubt by tuned.json: {tuned['fit']['doubts'][0]}.")
