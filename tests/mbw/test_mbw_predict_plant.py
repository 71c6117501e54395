"""``mbw predict`` on a tuning: bands, samples, uncertain plant, weight, and files for control.

Every file is opened again by numpy, scipy and python-control alone.
"""

import csv
import io
import json
import re
import sys
from types import SimpleNamespace

import control
import numpy as np
import pytest
import scipy.io
from browser import CHROMIUM, GL, browse, data_of, unpacked
from campaign_folder import write_folder

from mbw.predict import alternative_plants
from tests.helpers.command import invoke as mbw

PORTS = (
    "--input",
    "acc4:+tx",
    "--input",
    "head:+ry",
    "--output",
    "acc1:+tz",
    "--output",
    "acc3:+tx",
)
BAND = ("--band", 5, 150, "--lines", 59)


def predict(*arguments):
    result = mbw("predict", *arguments, *PORTS, *BAND)
    assert result.exit_code == 0, result.stderr
    return result


@pytest.fixture(scope="session")
def tuned(tmp_path_factory):
    """Folder of a tuning."""
    folder = write_folder(tmp_path_factory.mktemp("plant") / "campaign")
    out = folder.parent / "tuned"
    result = mbw("tune", folder, "--out", out, "--no-pictures", "-q")
    assert result.exit_code == 0, result.stderr
    return out


@pytest.fixture(scope="session")
def frfs(tuned):
    """FRFs between the ports by the command; lines, and (n_freq, n_out, n_in)."""
    result = predict(tuned / "tuned.xml", "--frf", "--quiet", "--no-pictures")
    rows = np.array(list(csv.reader(io.StringIO(result.stdout)))[1:], float)
    values = rows[:, 1::2] + 1j * rows[:, 2::2]
    return rows[:, 0], values.reshape(len(rows), 2, 2)


@pytest.fixture(autouse=True)
def no_slycot(monkeypatch):
    """With slycot, python-control evaluates faster and five digits worse."""
    monkeypatch.setitem(sys.modules, "slycot", None)


def load(path):
    """Arrays of a file by numpy or scipy alone."""
    if path.suffix == ".mat":
        return scipy.io.loadmat(path, squeeze_me=True)
    with np.load(path) as arrays:
        return dict(arrays)


def close_to(values, expected, tolerance=1e-8):
    return (np.abs(values - expected) <= tolerance * np.abs(expected).max(axis=0)).all()


def response(system, freq):
    """Response by python-control; (n_freq, n_out, n_in)."""
    return np.array([system(2j * np.pi * f, squeeze=False) for f in freq])


def test_bands_are_written_with_the_frfs_and_their_names(tuned, tmp_path, frfs):
    result = predict(tuned, "--bands", "--out", tmp_path, "--json", "-")
    arrays = load(tmp_path / "bands.npz")
    assert close_to(arrays["frf"], frfs[1])
    np.testing.assert_allclose(arrays["freq_hz"], frfs[0])
    assert list(arrays["outputs"]) == ["acc1:+tz", "acc3:+tx"]
    assert list(arrays["input_units"]) == ["N", "N m"]
    assert list(arrays["output_units"]) == ["m/s²", "m/s²"]
    half = 1.959964 * arrays["magnitude_deviation"]
    size = np.abs(arrays["frf"])
    across = np.sqrt(5.991465 - 1.959964**2) * arrays["phase_deviation"] * size
    np.testing.assert_allclose(arrays["high"], np.hypot(size + half, across), rtol=1e-6)
    row = json.loads(result.stdout)["bands"]
    shown = (arrays["high"] - arrays["low"]) / 2 / size
    assert row["median"] == pytest.approx(np.median(shown))
    assert 1e-3 < row["median"] < 0.1
    assert "95 % interval" in result.stderr


PROBE = """<script>setTimeout(() => {
  const shaded = byId("bode").data.filter(t => t.fill === "tonexty").map(t => t.y.length);
  const fills = document.querySelectorAll("#bode .js-fill").length;
  const said = byId("bode-remark").textContent;
  const found = JSON.stringify({shaded, fills, said, faults: FAULTS});
  document.body.append(element("pre", found, {id: "found"}));
}, 3000);</script>"""


def test_the_page_shades_the_interval_of_every_magnitude(tuned, tmp_path):
    predict(tuned, "--bands", "--out", tmp_path)
    page, bands = (tmp_path / "predict.html").read_text("utf-8"), load(tmp_path / "bands.npz")
    bode = data_of(page)["bode"]
    freq = unpacked(bode["freq"])
    shown = {end: unpacked(bode[end]).reshape(4, -1) for end in ("low", "high")}
    common = [np.flatnonzero(np.isclose(freq, line, rtol=1e-6)) for line in bands["freq_hz"]]
    lines = [k for k, places in enumerate(common) if len(places) == 1]
    assert len(lines) > 50
    places = [common[k][0] for k in lines]
    pairs = [label.split(" / ") for label in bode["labels"]]
    for row, (out, inp) in enumerate(pairs):
        cell = list(bands["outputs"]).index(out), list(bands["inputs"]).index(inp)
        for end, values in shown.items():
            np.testing.assert_allclose(
                values[row, places], bands[end][lines][:, *cell], rtol=1e-4, atol=1e-9
            )
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    drawn_page = browse(page, tmp_path, *GL, probe=PROBE)
    assert drawn_page["faults"] == []
    assert drawn_page["shaded"] == [len(freq)] * 4
    assert drawn_page["fills"] == 4
    assert drawn_page["said"].startswith("Shaded: 95 % interval of the magnitude")


def test_the_page_of_a_model_without_a_tuning_shades_nothing(tuned, tmp_path):
    predict(tuned / "tuned.xml", "--out", tmp_path)
    assert "high" not in data_of((tmp_path / "predict.html").read_text("utf-8"))["bode"]


def test_the_csv_has_the_ends_of_the_intervals(tuned, tmp_path):
    result = predict(tuned, "--bands", "--frf", "--out", tmp_path)
    header, *rows = csv.reader(io.StringIO(result.stdout))
    assert header[1:5] == [
        f"{part} acc1:+tz / acc4:+tx" for part in ("Re", "Im", "low |H|", "high |H|")
    ]
    table = np.array(rows, float)
    size = np.hypot(table[:, 1], table[:, 2])
    assert (table[:, 3] <= size).all()
    assert (size <= table[:, 4]).all()


def test_samples_have_parameters_frfs_and_state_spaces(tuned, tmp_path):
    predict(tuned, "--samples", 4, "--seed", 3, "--out", tmp_path, "--no-pictures")
    arrays = load(tmp_path / "samples.npz")
    assert arrays["parameters"].shape == (4, len(arrays["parameter_names"]))
    for k in range(4):
        system = control.ss(*(arrays[name][k] for name in "ABCD"))
        assert close_to(response(system, arrays["freq_hz"]), arrays["frf"][k])
    predict(tuned, "--samples", 4, "--seed", 4, "--out", tmp_path / "other", "--no-pictures")
    other = load(tmp_path / "other" / "samples.npz")
    assert not np.array_equal(arrays["parameters"], other["parameters"])


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_the_uncertain_plant_is_read_by_python_control_alone(tuned, tmp_path, frfs, suffix):
    target = tmp_path / f"uncertain{suffix}"
    result = predict(tuned, "--uncertain", target, "--no-pictures", "--json", "-")
    file = load(target)
    ranks, width = file["ranks"], int(file["ranks"].sum())
    whole = control.ss(*(file[name] for name in "ABCD"))
    assert whole.ninputs == width + 2
    # u, w and y, v in python-control's order of a lower transformation
    order_in = [*range(width, width + 2), *range(width)]
    turned = control.ss(
        whole.A, whole.B[:, order_in], whole.C[order_in], whole.D[np.ix_(order_in, order_in)]
    )
    nominal = turned.lft(control.ss([], [], [], np.zeros((width, width))))
    assert close_to(response(nominal, frfs[0]), frfs[1])
    row = json.loads(result.stdout)["uncertain_plant"]
    assert row["blocks"] == len(file["blocks"])
    assert row["width"] == width
    assert 0 < row["exact_blocks"] <= row["blocks"]
    assert row["max_error"] == pytest.approx(float(file["error"]))
    stiff = list(file["blocks"]).index("head_tx.stiffness")
    assert ranks[stiff] == 1
    assert file["is_exact"][stiff]
    # the standard deviation of a block is that of the table of parameters
    table = json.loads((tuned / "tuned.json").read_text())["parameters"]
    stated = next(item for item in table if item["name"] == "head_tx.stiffness")
    assert file["deviation"][stiff] == pytest.approx(stated["deviation"])


def test_the_weight_bounds_the_held_out_error(tuned, tmp_path):
    arguments = (tuned, "--weight", 3, "--out", tmp_path, "--no-pictures", "--json", "-")
    row = json.loads(predict(*arguments).stdout)["weight"]
    assert row["has_one_unit"]
    for name in ("weight.npz", "weight.mat"):
        path = tmp_path / name
        file = load(path)
        weight = control.tf(file["numerator"], file["denominator"])
        values = np.abs(weight(2j * np.pi * file["freq_hz"]))
        assert (values >= file["error"]).all()
        assert (values / file["error"]).max() == pytest.approx(row["ratio"], rel=1e-4)
        assert (weight.poles().real < 0).all()
        assert (weight.zeros().real < 0).all()


def test_the_state_space_has_names_units_and_quantity(tuned, tmp_path, frfs):
    target = tmp_path / "plant.mat"
    predict(tuned, "--statespace", target, "--no-pictures", "--input-delay", "acc4:+tx=0.002")
    file = load(target)
    system = control.ss(*(file[name] for name in "ABCD"), inputs=list(file["inputs"]))
    assert close_to(response(system, frfs[0]), frfs[1])
    assert file["quantity"] == "accelerance"
    assert list(file["input_units"]) == ["N", "N m"]
    assert file["Ts"] == 0
    assert list(file["input_delay"]) == [0.002, 0.0]


def test_the_discrete_state_space_has_its_period_and_holds_the_delays(tuned, tmp_path, frfs):
    target, period = tmp_path / "plant.npz", 2e-4
    predict(
        tuned, "--statespace", target, "--no-pictures", "--discrete", period, "--input-delay", 5e-4
    )
    file = load(target)
    assert file["Ts"] == period
    assert not file["input_delay"].any()
    assert list(file["states"][-3:]) == [f"head:+ry[k-{age}]" for age in (1, 2, 3)]
    system = control.ss(*(file[name] for name in "ABCD"), dt=period)
    freq = frfs[0]
    z = np.exp(2j * np.pi * freq * period)
    values = np.array([system(point, squeeze=False) for point in z])
    # a hold lags by half a period; aliases of the feed-through of an accelerance remain
    late = np.exp(-2j * np.pi * freq * (5e-4 + period / 2)) * np.sinc(freq * period)
    assert close_to(values, frfs[1] * late[:, None, None], 0.2)


@pytest.mark.parametrize("method", ["balanced", "modal"])
def test_the_reduced_state_space_errs_less_than_stated(tuned, tmp_path, frfs, method):
    target = tmp_path / "plant.npz"
    arguments = (tuned, "--statespace", target, "--reduce", method, "--no-pictures")
    row = json.loads(predict(*arguments, "--order", 8, "--json", "-").stdout)["reduction"]
    file = load(target)
    assert len(file["A"]) == row["states"] == 8
    error = np.abs(response(control.ss(*(file[name] for name in "ABCD")), frfs[0]) - frfs[1])
    largest = (error.max(axis=0) / np.abs(frfs[1]).max(axis=0)).max()
    assert largest == pytest.approx(row["max_error"], rel=1e-6)
    assert 0 < largest <= row["bound"]


def test_the_interval_chooses_the_order(tuned, tmp_path, frfs):
    target = tmp_path / "plant.npz"
    arguments = (
        tuned,
        "--statespace",
        target,
        "--reduce",
        "balanced",
        "--out",
        tmp_path,
        "--bands",
    )
    result = predict(*arguments, "--json", "-")
    row = json.loads(result.stdout)["reduction"]
    assert row["states"] <= row["whole_states"]
    bands, file = load(tmp_path / "bands.npz"), load(target)
    values = response(control.ss(*(file[name] for name in "ABCD")), frfs[0])
    half = (bands["high"] - bands["low"]) / 2
    assert (np.abs(values - frfs[1]) <= half / 3 * (1 + 1e-6)).all()


def test_a_payload_leaves_the_uncertainty_of_the_machine(tuned, tmp_path):
    plain, loaded = tmp_path / "plain", tmp_path / "loaded"
    predict(tuned, "--bands", "--out", plain, "--no-pictures")
    predict(tuned, "--bands", "--out", loaded, "--no-pictures", "--add-mass", "head=20@0,0,0.1")
    widths = [
        np.median((file["high"] - file["low"]) / np.abs(file["frf"]))
        for file in (load(folder / "bands.npz") for folder in (plain, loaded))
    ]
    assert 0.3 < widths[1] / widths[0] < 3


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("--reduce", "pod", "--statespace", "x.mat"), 2, "balanced or modal"),
        (("--reduce", "modal"), 2, "--statespace"),
        (("--discrete", "0.001"), 2, "--statespace"),
        (("--discrete", "-1", "--statespace", "x.mat"), 2, "above 0"),
        (("--uncertain", "x.txt"), 2, ".npz or .mat"),
        (("--input-delay", "acc9:+tx=1e-3", "--statespace", "x.mat"), 2, "none of the inputs"),
        (("--input-delay", "late", "--statespace", "x.mat"), 2, "INPUT=SECONDS"),
        (("--input-delay", "12", "--statespace", "x.mat"), 3, "0 to 10 s"),
        (("--weight", "70"), 2, "0 to 20"),
    ],
)
def test_what_cannot_be_used_is_refused(tuned, tmp_path, monkeypatch, arguments, code, words):
    monkeypatch.chdir(tmp_path)
    result = mbw("predict", tuned, *arguments, *PORTS, *BAND, "--out", "out")
    assert result.exit_code == code
    assert words in result.stderr
    assert not list(tmp_path.glob("x.*"))


def test_without_a_tuning_there_are_no_bands(tuned, tmp_path):
    model = tmp_path / "plain.xml"
    model.write_text((tuned / "tuned.xml").read_text(encoding="utf-8"), encoding="utf-8")
    result = mbw("predict", model, "--bands", *PORTS)
    assert result.exit_code == 3
    assert "posterior.npz is missing" in result.stderr
    result = mbw("predict", tmp_path, "--bands", *PORTS)
    assert result.exit_code == 3
    assert "no tuned.xml" in result.stderr
    changed = tmp_path / "tuned.xml"
    text = model.read_text(encoding="utf-8").replace('mass="', 'mass="1', 1)
    changed.write_text(text.replace('stiffness="', 'stiffness="1', 1), encoding="utf-8")
    (tmp_path / "posterior.npz").write_bytes((tuned / "posterior.npz").read_bytes())
    result = mbw("predict", changed, "--bands", *PORTS)
    assert result.exit_code == 3
    assert "changed after the fit" in result.stderr


def test_causes_of_a_diagnosis_widen_the_bands(tuned, tmp_path, monkeypatch):
    # an augmented model whose spring is stiffer, with a probability of 0.6
    text = (tuned / "tuned.xml").read_text(encoding="utf-8")
    value = re.search(r'name="head_tx"[^>]*?stiffness="([^"]+)"', text)[1]
    text = text.replace(f'stiffness="{value}"', f'stiffness="{2 * float(value.split()[0])!r}"', 1)
    (tmp_path / "augmented.xml").write_text(text, encoding="utf-8")
    cause = SimpleNamespace(effect="parallel_path", location="pair:base-head", probability=0.6)
    row = SimpleNamespace(cause=0)
    result = SimpleNamespace(
        verdict=SimpleNamespace(
            causes=[cause], twins=[("parallel_path@pair:base-head", "drift@joint:head")]
        ),
        shown=SimpleNamespace(
            established=[row], not_held_by_mjcf=["its delay", "acc1.gain_x (no gain)"]
        ),
    )
    monkeypatch.setattr(alternative_plants, "read_result", lambda _: result)
    folders = tmp_path / "plain", tmp_path / "both"
    predict(tuned, "--bands", "--no-pictures", "--out", folders[0])
    said = predict(
        tuned, "--bands", "--no-pictures", "--out", folders[1], "--diagnosed", tmp_path
    ).stderr
    assert "tuned (40 %), parallel_path@pair:base-head (60 %)" in said
    assert "stands for drift@joint:head (confounded) too, whose own plant is not" in said
    assert "its delay" in said
    assert "acc1.gain_x" not in said
    plain, both = (load(folder / "bands.npz") for folder in folders)
    assert list(both["weights"]) == [0.4, 0.6]
    other = np.abs(both["alternative_frf"][1])
    apart = (other > 2 * plain["high"]) | (other < plain["low"] / 2)
    assert apart.any()
    assert (both["low"] <= other)[apart].all()
    assert (both["high"] >= other)[apart].all()
    assert (both["high"] >= np.abs(plain["frf"]))[apart].all()
    result.shown.established = []
    refused = mbw("predict", tuned, "--bands", *PORTS, "--diagnosed", tmp_path, "--out", folders[1])
    assert refused.exit_code == 3
    assert "established no cause" in refused.stderr
