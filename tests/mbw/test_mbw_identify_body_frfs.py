"""FRFs at the centres of mass that ``mbw identify`` writes, against an independent reduction."""

import json

import numpy as np
import pytest
import pyuff
import scipy.io
from campaign_folder import write_folder
from typer.testing import CliRunner

from identification.readers.uff_frfs import read_uff
from identification.words import Dof
from mbw.command import app

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("small") / "campaign", lines=121)


@pytest.fixture(scope="module")
def out(folder, tmp_path_factory):
    place = tmp_path_factory.mktemp("identified") / "result"
    outcome = RUNNER.invoke(
        app, ["identify", str(folder), "--out", str(place), "--no-pictures", "-q"]
    )
    assert outcome.exit_code == 0, outcome.stderr
    return place


def readings_per_motion(layout, outputs, body):
    """Rows [a, r x a] of the channels on a body, from positions and axes (seed, eq. 2.4)."""
    rows, channels = [], []
    for channel, label in enumerate(outputs):
        point, direction = label.split(":")
        index = list(layout["layout_points"]).index(point)
        if layout["layout_body_of"][index] != body:
            continue
        axis = layout["layout_axes"][index][:, "xyz".index(direction[-1])]
        arm = layout["layout_positions"][index] - layout["layout_centres"][body]
        rows.append([*axis, *np.cross(arm, axis)])
        channels.append(channel)
    return np.array(rows), channels


def test_each_motion_is_the_least_squares_solution_of_its_channels(out):
    content = json.loads((out / "modes.json").read_text("utf-8"))
    assert content["body_frfs"] == "body_frfs.npz"
    with np.load(out / "body_frfs.npz") as written, np.load(out / "modes.npz") as arrays:
        assert written["frf"].shape == (content["lines"], 6 * len(written["bodies"]), 3)
        assert list(written["inputs"]) == content["inputs"]
        np.testing.assert_array_equal(written["freq_hz"], arrays["freq_hz"])
        for body, name in enumerate(written["bodies"]):
            rows, channels = readings_per_motion(arrays, content["outputs"], body)
            labels = [f"{name}:+{d}" for d in ("tx", "ty", "tz", "rx", "ry", "rz")]
            places = [list(written["outputs"]).index(label) for label in labels]
            for column in range(3):
                readings = arrays["measured"][:, channels, column].T
                motion = np.linalg.lstsq(rows, readings, rcond=None)[0].T
                np.testing.assert_allclose(written["frf"][:, places, column], motion, rtol=1e-8)


def test_the_covariance_is_that_of_noise_through_the_reduction(out):
    content = json.loads((out / "modes.json").read_text("utf-8"))
    random = np.random.default_rng(5)
    with np.load(out / "body_frfs.npz") as written, np.load(out / "modes.npz") as arrays:
        line, column, body = 40, 1, 1
        rows, channels = readings_per_motion(arrays, content["outputs"], body)
        deviation = arrays["noise_sd"][line, channels, column].astype(float)
        noise = random.normal(size=(20_000, len(channels), 2)) * deviation[:, None] / np.sqrt(2)
        motion = np.linalg.lstsq(rows, (noise[..., 0] + 1j * noise[..., 1]).T, rcond=None)[0]
        scatter = motion @ motion.conj().T / motion.shape[1]
        covariance = written["covariance"][line, column, body]
        size = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose(
            scatter / np.outer(size, size), covariance / np.outer(size, size), atol=0.03
        )
        assert abs(covariance / np.outer(size, size) - np.eye(6)).max() > 0.1
        name = str(written["bodies"][body])
        place = list(written["outputs"]).index(f"{name}:+tx")
        np.testing.assert_allclose(
            written["variance"][line, place : place + 6, column], np.diag(covariance)
        )


def test_matlab_gets_the_same_frfs_with_labels_and_units(out):
    with np.load(out / "body_frfs.npz") as written:
        file = scipy.io.loadmat(out / "body_frfs.mat")
        np.testing.assert_array_equal(np.moveaxis(file["FRFs"], 2, 0), written["frf"])
        np.testing.assert_array_equal(file["freqs"].ravel(), written["freq_hz"])
        np.testing.assert_array_equal(
            file["covariance"].transpose(4, 3, 2, 0, 1), written["covariance"]
        )
        assert [str(cell[0][0]) for cell in file["outputs"]] == list(written["outputs"])
        assert [str(cell[0][0]) for cell in file["inputs"]] == list(written["inputs"])
        units = dict(zip(written["outputs"], written["units"], strict=True))
        name = written["bodies"][0]
        assert list(units[f"{name}:+tx"]) == ["m/s²/N"] * 3
        assert list(units[f"{name}:+rz"]) == ["rad/s²/N"] * 3
        assert str(file["units"][3, 0][0]) == "rad/s²/N"


def test_without_a_determined_motion_no_file_is_named(folder, tmp_path):
    # One sensor away from the centre of mass: what it reads may be translation or rotation.
    (tmp_path / "poor").mkdir()
    for name in ("model.xml", "impact.mat"):
        (tmp_path / "poor" / name).write_bytes((folder / name).read_bytes())
    text = (folder / "campaign.toml").read_text("utf-8")
    ignored = "".join(
        f'\n[sensor.acc{node}]\nignore = ["x", "y", "z"]\n' for node in (1, 2, 4, 5, 6)
    )
    (tmp_path / "poor" / "campaign.toml").write_text(text + ignored, encoding="utf-8")
    outcome = RUNNER.invoke(
        app, ["identify", str(tmp_path / "poor"), "--out", str(tmp_path / "out"), "--no-pictures"]
    )
    assert outcome.exit_code == 0, outcome.stderr
    content = json.loads((tmp_path / "out" / "modes.json").read_text("utf-8"))
    assert content["body_frfs"] is None
    assert not (tmp_path / "out" / "body_frfs.npz").exists()


def test_pyuff_reads_the_same_frfs_at_the_nodes_of_the_bodies(out):
    sets = pyuff.UFF(str(out / "body_frfs.uff")).read_sets()
    nodes = next(data for data in sets if data["type"] == 15)
    functions = [data for data in sets if data["type"] == 58]
    with np.load(out / "body_frfs.npz") as written:
        assert list(nodes["node_nums"]) == [1001, 1002]
        places = np.column_stack([nodes[axis] for axis in "xyz"])
        np.testing.assert_allclose(places, written["centres"], atol=1e-5)
        assert len(functions) == written["measured"].sum()
        inputs = [(3, 1), (3, -2 if "-" in str(written["inputs"][1]) else 2), (3, 3)]
        seen = set()
        for data in functions:
            body = str(written["bodies"][int(data["rsp_node"]) - 1001])
            direction = ("tx", "ty", "tz", "rx", "ry", "rz")[int(data["rsp_dir"]) - 1]
            row = list(written["outputs"]).index(f"{body}:+{direction}")
            column = inputs.index((int(data["ref_node"]), int(data["ref_dir"])))
            seen.add((row, column))
            np.testing.assert_allclose(data["data"], written["frf"][:, row, column], rtol=1e-10)
            np.testing.assert_allclose(data["x"], written["freq_hz"], rtol=1e-5)
            unit = "rad/s^2" if direction.startswith("r") else "m/s^2"
            assert data["ordinate_axis_units_lab"].strip() == unit
        assert len(seen) == len(functions)


def test_the_reader_of_campaigns_reads_the_universal_file(out):
    table = read_uff(out / "body_frfs.uff")
    assert table.quantity == "accelerance"
    with np.load(out / "body_frfs.npz") as written:
        for label, values in zip(
            written["outputs"], written["frf"].transpose(1, 0, 2), strict=True
        ):
            body, direction = label.split(":")
            node = 1001 + list(written["bodies"]).index(body)
            row = table.responses.index(Dof.parse(f"{node}:{direction}"))
            for column, dof in enumerate(table.references):
                place = list(written["inputs"]).index(f"acc{dof}")
                np.testing.assert_allclose(
                    table.values[:, row, column], values[:, place], rtol=1e-9
                )
