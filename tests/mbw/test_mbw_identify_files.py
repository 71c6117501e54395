"""The files of ``mbw identify``, and what its options do, on a small machine."""

import csv
import json
import re
import shutil

import numpy as np
import pytest
import pyuff
import scipy.io
from campaign_folder import write_folder

from identification.modal import mac
from identification.result.stored_result import read_result
from identification.words import Dof, ModalModel
from mbmodel import as_drawn, load_machine, model_modes, shapes_at
from mbw.identify.files import write_full_matrix
from tests.helpers.command import invoke as mbw


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("small") / "campaign", lines=321)


@pytest.fixture(scope="module")
def out(folder, tmp_path_factory):
    place = tmp_path_factory.mktemp("identified") / "result"
    outcome = mbw("identify", folder, "--out", place, "--full")
    assert outcome.exit_code == 0, outcome.stderr
    return place


@pytest.fixture(scope="module")
def content(out):
    return json.loads((out / "modes.json").read_text("utf-8"))


def test_pyuff_gives_poles_scaling_and_shapes_back(out, content):
    file = pyuff.UFF(str(out / "modes.unv"))
    modes = [data for data in file.read_sets() if data["type"] == 55]
    assert len(modes) == len(content["modes"]) >= 4
    channels = {label: k for k, label in enumerate(content["outputs"])}
    for data, row in zip(modes, content["modes"], strict=True):
        assert data["eig"] == pytest.approx(complex(row["real"], row["imaginary"]), rel=1e-5)
        scale = complex(row["modal_a_real"], row["modal_a_imaginary"])
        assert data["modal_a"] == pytest.approx(scale, rel=1e-5)
        node = list(data["node_nums"]).index(4)
        for key, axis in (("r1", "x"), ("r2", "y"), ("r3", "z")):
            k = channels[f"acc4:+t{axis}"]
            entry = complex(row["shape_real"][k], row["shape_imaginary"][k])
            assert data[key][node] == pytest.approx(entry, rel=1e-5, abs=1e-9)


def test_matlab_gets_the_model_with_its_names(out, content):
    file = scipy.io.loadmat(out / "modes.mat")
    count = len(content["modes"])
    assert file["freqs"].ravel() == pytest.approx([row["frequency"] for row in content["modes"]])
    assert file["damping"].ravel() == pytest.approx([row["damping"] for row in content["modes"]])
    assert file["shapes"].shape == (len(content["outputs"]), count)
    assert [str(cell[0][0]) for cell in file["outputs"]] == content["outputs"]
    assert [str(cell[0][0]) for cell in file["inputs"]] == content["inputs"]
    assert str(file["quantity"][0]) == "accelerance"
    np.testing.assert_allclose(file["modal_a"].ravel(), 2j * file["poles"].ravel().imag)


def test_the_tables_are_what_the_json_says(out, content):
    with (out / "modes.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["frequency"]) for row in rows] == [r["frequency"] for r in content["modes"]]
    for row, mode in zip(rows, content["modes"], strict=True):
        assert not any(value.startswith(("{", "[")) for value in row.values())
        for name, value in mode["by_hand"].items():
            text = row[f"by_hand_{name}"]
            assert text == value if isinstance(value, str) else float(text or 0) == (value or 0)
    with (out / "shapes.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    labels = content["outputs"] + content["body_directions"]
    assert [row["channel"] for row in rows] == labels
    assert float(rows[3]["im_2"]) == content["modes"][1]["shape_imaginary"][3]
    assert float(rows[3]["real_2"]) == content["modes"][1]["real_shape"][3]
    assert float(rows[-1]["re_1"]) == content["modes"][0]["body_shape_real"][-1]


def test_the_error_of_each_channel_is_that_of_its_synthesis(out, content):
    with (out / "synthesis.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with np.load(out / "modes.npz") as arrays:
        assert len(rows) == arrays["is_measured"].sum()
        for row in rows:
            cell = content["outputs"].index(row["output"]), content["inputs"].index(row["input"])
            seen, made = arrays["measured"][:, *cell], arrays["synthesised"][:, *cell]
            error = np.linalg.norm(made - seen) / np.linalg.norm(seen)
            assert float(row["error"]) == pytest.approx(error)
    moving = [float(row["error"]) for row in rows if float(row["noise"]) < 0.05]
    assert len(moving) > 10
    assert max(moving) < 0.05
    assert content["error"] < 1.2 * content["noise"]


def test_the_full_matrix_has_the_measured_columns_but_for_what_lies_beside(out, content):
    with np.load(out / "full_matrix.npz") as full, np.load(out / "modes.npz") as arrays:
        assert full["frf"].shape == (content["lines"], 18, 18)
        np.testing.assert_allclose(
            full["frf"], full["frf"].transpose(0, 2, 1), rtol=1e-3, atol=1e-9
        )
        column = content["outputs"].index("acc3:+tx")
        row = content["outputs"].index("acc1:+tx")
        made, seen = full["frf"][:, row, column], arrays["measured"][:, row, 0]
        assert np.linalg.norm(made - seen) < 0.03 * np.linalg.norm(seen)


def test_shapes_are_mass_normalised_as_those_of_the_machine(out, content, folder):
    assert content["normalisation"] == "unit modal mass"
    with np.load(out / "modes.npz") as arrays:
        count = len(content["modes"])
        model = ModalModel(
            **{
                name: arrays[name]
                for name in ("poles", "shapes", "participation", "lower", "upper")
            },
            outputs=tuple(map(Dof.parse, content["outputs"])),
            inputs=tuple(map(Dof.parse, content["inputs"])),
            freq_sd=arrays["freq_sd"],
            damping_sd=arrays["damping_sd"],
        )
        np.testing.assert_allclose(
            model.modal_a[:count], 2j * arrays["poles"][:count].imag, rtol=1e-6, atol=1e-6
        )


def test_measured_shapes_are_compared_with_the_nominal_model(out, content, folder):
    drawn = as_drawn(load_machine(folder / "model.xml"))
    found = model_modes(drawn, drawn.drawn)
    shapes = shapes_at(drawn, drawn.drawn, found, tuple(map(Dof.parse, content["outputs"])))
    assert content["compared_with"] == "pair as drawn"
    pairs = [row for row in content["modes"] if row["other"] is not None]
    assert len(pairs) >= 3
    for row in pairs:
        near = int(np.argmin(np.abs(found.freq_hz - row["other"])))
        own = np.array(row["shape_real"]) + 1j * np.array(row["shape_imaginary"])
        assert mac(own[:, None], shapes[:, [near]])[0, 0] == pytest.approx(row["other_mac"])


def test_against_its_own_file_every_mode_pairs_with_itself(out, folder, tmp_path):
    shapes = out / "modes.unv"
    result = mbw(
        "identify", folder, "--against", shapes, "--out", tmp_path, "--no-pictures", "--json", "-"
    )
    content = json.loads(result.stdout)
    assert content["compared_with"] == "modes.unv"
    for row in content["modes"]:
        assert row["other"] == pytest.approx(row["frequency"], rel=1e-4)
        assert row["other_mac"] == pytest.approx(1.0, abs=1e-4)
    assert not (tmp_path / "identify.html").exists()


def test_a_file_of_other_nodes_is_refused(folder, out, tmp_path):
    text = (out / "modes.unv").read_text("ascii")
    for node in range(1, 7):
        text = text.replace(f"\n{node:10d}\n", f"\n{node + 900:10d}\n")
    (tmp_path / "far.unv").write_text(text, encoding="ascii")
    result = mbw("identify", folder, "--against", tmp_path / "far.unv", "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "none of which was measured" in result.stderr


def test_a_result_comes_back_from_its_files(out, content, tmp_path):
    result = read_result(out)
    assert json.loads(result.summary.model_dump_json()) == content
    write_full_matrix(result, tmp_path)
    assert (tmp_path / "full_matrix.npz").read_bytes() == (out / "full_matrix.npz").read_bytes()


def test_a_damaged_result_is_refused(out, tmp_path):
    shutil.copytree(out, tmp_path / "result")
    (tmp_path / "result" / "modes.npz").write_bytes(b"")
    result = mbw("report", tmp_path / "result")
    assert result.exit_code == 3
    assert "run mbw identify again" in result.stderr


def test_a_mode_that_is_dropped_is_gone(folder, content, tmp_path):
    gone = content["modes"][1]["frequency"]
    result = mbw(
        "identify", folder, "--drop", gone, "--out", tmp_path, "--no-pictures", "--json", "-"
    )
    assert result.exit_code == 0, result.stderr
    found = [row["frequency"] for row in json.loads(result.stdout)["modes"]]
    assert min(abs(freq - gone) for freq in found) > 0.01 * gone


def test_a_forced_mode_stays_where_it_is_put(folder, content, tmp_path):
    place = content["modes"][1]["frequency"] * 1.001
    result = mbw(
        "identify", folder, "--force", f"{place},2.5", "--out", tmp_path, "--no-pictures", "-q",
        "--json", "-",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    rows = json.loads(result.stdout)["modes"]
    held = min(rows, key=lambda row: abs(row["frequency"] - place))
    assert held["frequency"] == pytest.approx(place)
    assert held["damping"] == pytest.approx(0.025)
    assert result.stderr == ""


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--drop", "3.3"), "3.3 Hz"),
        (("--drop", "33.3"), "no mode to drop at 33.3 Hz"),
        (("--force", "50"), "--force 50 does not state a frequency and a damping ratio"),
        (("--force", "50,ten"), "write --force 120.5,2"),
        (("--force", "50,120"), "between 0 and 100 per cent"),
        (("--mac-tolerance", "2"), "mac-tolerance"),
    ],
)
def test_options_that_make_no_sense_are_refused_in_a_sentence(folder, tmp_path, options, words):
    result = mbw("identify", folder, "--out", tmp_path / "out", *options)
    assert result.exit_code == 2
    assert words in result.stderr
    assert not list((tmp_path / "out").glob("modes*"))


def test_a_band_without_modes_is_said_in_a_sentence_with_what_to_do(folder, content, tmp_path):
    gaps = np.diff([mode["frequency"] for mode in content["modes"]])
    k = int(np.argmax(gaps))
    low, high = (content["modes"][n]["frequency"] for n in (k, k + 1))
    band = low + 0.25 * (high - low), high - 0.25 * (high - low)
    result = mbw("identify", folder, "--band", *band, "--out", tmp_path / "none", "--no-pictures")
    assert result.exit_code == 0, result.stderr
    assert json.loads((tmp_path / "none" / "modes.json").read_text("utf-8"))["modes"] == []
    words = " ".join(result.stderr.split())
    assert "No mode was identified in" in words
    assert "widen --band" in words


def test_stricter_tolerances_find_fewer_orders(folder, content, tmp_path):
    result = mbw(
        "identify", folder, "--frequency-tolerance", "0.001", "--damping-tolerance", "0.05",
        "--out", tmp_path, "--no-pictures", "--json", "-",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr

    def counts(modes):
        return sum(row["orders"] or 0 for row in modes)

    assert counts(json.loads(result.stdout)["modes"]) < counts(content["modes"])


def test_a_folder_in_the_place_of_a_file_is_refused_before_the_work(folder, tmp_path):
    (tmp_path / "modes.unv").mkdir()
    result = mbw("identify", folder, "--out", tmp_path)
    assert result.exit_code == 3
    assert "modes.unv is a folder" in result.stderr


@pytest.fixture(scope="module")
def undriven(folder, tmp_path_factory):
    """The same tests by a layout on which the driven channels were ignored."""
    target = tmp_path_factory.mktemp("undriven") / "campaign"
    shutil.copytree(folder, target)
    text = (target / "campaign.toml").read_text("utf-8")
    text += "\n[sensor.acc3]\nignore = ['x', 'y', 'z']\n"
    text += "\n[sensor.acc4]\nignore = ['x', 'y', 'z']\n"
    (target / "campaign.toml").write_text(text, encoding="utf-8")
    return target


def test_without_a_drive_point_shapes_have_no_scale(undriven, tmp_path):
    result = mbw("identify", undriven, "--out", tmp_path, "--json", "-")
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    assert content["normalisation"] == "largest entry 1"
    assert content["reciprocal_error"] is None
    assert content["modes"][0]["modal_a_real"] is None
    assert content["undetermined_bodies"] == ["head"]
    assert "Without a drive point shapes have no scale" in (tmp_path / "identify.html").read_text(
        "utf-8"
    )


def test_without_a_drive_point_the_full_matrix_is_refused(undriven, tmp_path):
    result = mbw("identify", undriven, "--out", tmp_path / "out", "--full")
    assert result.exit_code == 2
    assert "without such a drive point modes have no scale" in result.stderr
    assert not (tmp_path / "out").exists()


def test_shapes_and_their_scaling_alone_answer_like_the_measurement(content):
    # The machine is reciprocal and nearly all of its modes lie in the band.
    assert content["noise"] < content["reciprocal_error"] < 2 * content["noise"]


def test_of_a_roving_hammer_the_points_that_were_hit_carry_the_shape(folder, out, tmp_path):
    shutil.copytree(folder, tmp_path / "roving")
    file = scipy.io.loadmat(folder / "impact.mat")
    turned = {name: file[name].transpose(1, 0, 2) for name in ("FRFs", "COHs")}
    scipy.io.savemat(tmp_path / "roving" / "impact.mat", {**turned, "freqs": file["freqs"]})
    toml = tmp_path / "roving" / "campaign.toml"
    hits = [f"{node}:+{axis}" for node in range(1, 7) for axis in "xyz"]
    text = re.sub("references = .*", f"references = {hits}", toml.read_text("utf-8"))
    text = re.sub("channels = .*", 'channels = ["3:+x", "3:-y", "3:+z"]', text)
    toml.write_text(text, encoding="utf-8")
    result = mbw("identify", tmp_path / "roving", "--out", tmp_path / "out", "--json", "-")
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    fixed = json.loads((out / "modes.json").read_text("utf-8"))
    assert content["roved"]
    assert content["outputs"] == fixed["outputs"]
    assert len(content["modes"]) == len(fixed["modes"])
    for one, other in zip(content["modes"], fixed["modes"], strict=True):
        assert one["frequency"] == pytest.approx(other["frequency"], rel=1e-3)
        assert mac_of(one, other) > 0.999
    assert "The hammer roved" in (tmp_path / "out" / "identify.html").read_text("utf-8")


def mac_of(one, other):
    a, b = (
        np.array(row["shape_real"]) + 1j * np.array(row["shape_imaginary"]) for row in (one, other)
    )
    return mac(a[:, None], b[:, None])[0, 0]
