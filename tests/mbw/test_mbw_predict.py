"""``mbw predict`` in-process."""

import csv
import io
import json

import numpy as np
import pytest
import scipy.io
from small_machine import MJCF

from identification.words import Dof
from mbmodel import (
    Evaluator,
    FrfRequest,
    as_drawn,
    energy_shares,
    load_machine,
    model_modes,
    modes_of_matrices,
)
from tests.helpers.command import invoke as mbw

DRIVEN = """
<mujoco model="driven">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="slide">
      <inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
      <joint name="slide_tx" type="slide" axis="1 0 0" stiffness="1e6" damping="100"/>
      <joint name="slide_ty" type="slide" axis="0 1 0"/>
      <joint name="slide_tz" type="slide" axis="0 0 1" stiffness="1e3" damping="1e4"/>
      <site name="acc1" pos="0 0 0.1"/>
      <body name="rotor" pos="0 0 0.2">
        <inertial pos="0.01 0 0" mass="2" diaginertia="0.1 0.1 0.2"/>
        <joint name="rotor_rz" type="hinge" axis="0 0 1" stiffness="500" damping="1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="slide_tx" gear="3"/></actuator>
</mujoco>
"""


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """Pictures go to the current folder unless asked otherwise."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def driven(tmp_path):
    path = tmp_path / "driven.xml"
    path.write_text(DRIVEN, encoding="utf-8")
    return path


@pytest.fixture
def drawing(tmp_path):
    path = tmp_path / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path


def test_modes_are_printed_and_written_as_json(drawing, tmp_path):
    result = mbw("predict", drawing, "--json", tmp_path / "modes.json")
    assert result.exit_code == 0
    found = modes_of_matrices(
        as_drawn(load_machine(drawing)).matrices(as_drawn(load_machine(drawing)).drawn)
    )
    assert f"{found.freq_hz[0]:.3f}" in result.stdout
    content = json.loads((tmp_path / "modes.json").read_text())
    assert [row["frequency"] for row in content["modes"]] == pytest.approx(found.freq_hz.tolist())
    assert content["bodies"] == ["base", "head"]


def test_frfs_are_csv_on_stdout(drawing):
    result = mbw(
        "predict", drawing, "--frf", "--input", "3:+x".replace("3", "acc3"), "--output",
        "head:-rz", "--output", "acc1:+tz", "--band", 10, 90, "--lines", 41,
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    rows = list(csv.reader(io.StringIO(result.stdout)))
    assert rows[0][:2] == ["frequency/Hz", "Re head:-rz / acc3:+tx"]
    table = np.array(rows[1:], float)
    model = as_drawn(load_machine(drawing))
    question = FrfRequest(
        np.linspace(10, 90, 41), (Dof("head", "-rz"), Dof("acc1", "+tz")), (Dof("acc3", "+tx"),)
    )
    values = Evaluator(model, question).at(model.drawn).values[:, :, 0]
    assert table[:, 0] == pytest.approx(question.freq_hz)
    assert table[:, 1::2] + 1j * table[:, 2::2] == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_the_state_space_reproduces_the_frfs(drawing, tmp_path, suffix):
    target = tmp_path / f"system{suffix}"
    result = mbw(
        "predict", drawing, "--statespace", target, "--input", "acc3:+x", "--output", "acc1:+z"
    )
    assert result.exit_code == 0, result.stderr
    data = scipy.io.loadmat(target) if suffix == ".mat" else dict(np.load(target))
    s = 2j * np.pi * 33.0
    size = len(data["A"])
    value = data["C"] @ np.linalg.solve(s * np.eye(size) - data["A"], data["B"]) + data["D"]
    model = as_drawn(load_machine(drawing))
    question = FrfRequest(np.array([33.0]), (Dof("acc1", "+tz"),), (Dof("acc3", "+tx"),))
    assert value[0, 0] == pytest.approx(Evaluator(model, question).at(model.drawn).values[0, 0, 0])


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("--frf", "--output", "nowhere:+tx"), 2, "nowhere"),
        (("--frf", "--output", "acc1"), 2, "label"),
        (("--frf", "--band", "90", "10"), 2, "90"),
        (("--frf", "--quantity", "inertance"), 2, "inertance"),
        (("--statespace", "system.txt"), 2, ".npz"),
        (("--input", "nowhere:+tx"), 2, "nowhere"),
        (("--spin", "head_rz"), 2, "JOINT=RATE"),
        (("--spin", "head_rz=fast"), 2, "JOINT=RATE"),
        (("--spin", "head_rz=inf"), 2, "JOINT=RATE"),
        (("--spin", "head_rz=1", "--spin", "head_rz=2"), 2, "twice"),
        (("--spin", "nowhere=1"), 2, "head_rz"),
        (("--json", "-", "--frf"), 2, "stdout"),
        (("--out", "pair.xml"), 2, "folder"),
    ],
)
def test_questions_without_sense_exit_2(drawing, arguments, code, words):
    result = mbw("predict", drawing, *arguments)
    assert result.exit_code == code
    assert words in result.stderr
    assert result.stdout == ""


def test_a_missing_model_exits_3(tmp_path):
    result = mbw("predict", tmp_path / "none.xml")
    assert result.exit_code == 3
    assert "does not exist" in result.stderr


def test_the_table_names_the_spring_to_touch_and_the_damper_that_works(drawing):
    result = mbw("predict", drawing, "--no-pictures")
    model = as_drawn(load_machine(drawing))
    found = model_modes(model, model.drawn)
    shares = energy_shares(model, model.drawn, found)
    lines = result.stdout.splitlines()[1:]
    assert len(lines) == len(found.poles)
    for number, line in enumerate(lines):
        spring = shares.springs[int(np.argmax(shares.strain[:, number]))]
        damper = shares.springs[int(np.argmax(shares.dissipation[:, number]))]
        assert line.split("%")[1].split()[0] == spring
        assert line.split()[-1] == damper


def test_the_table_fits_into_a_hundred_columns(drawing):
    assert max(map(len, mbw("predict", drawing, "--no-pictures").stdout.splitlines())) <= 100


def test_motions_at_rest_are_named_and_have_no_damping(driven, tmp_path):
    result = mbw("predict", driven, "--json", "modes.json", "--no-pictures")
    first = json.loads((tmp_path / "modes.json").read_text())["modes"][0]
    assert first["name"] == "rigid ty"
    assert first["damping"] is None
    assert "rigid ty" in result.stdout.splitlines()[1]


def test_poles_that_do_not_oscillate_are_called_overdamped(driven):
    lines = mbw("predict", driven, "--no-pictures").stdout.splitlines()
    assert sum("overdamped" in line and "slide_tz" in line for line in lines) == 2


def test_json_tells_shares_and_shapes(drawing, tmp_path):
    mbw("predict", drawing, "--json", "modes.json", "--no-pictures")
    content = json.loads((tmp_path / "modes.json").read_text())
    row = content["modes"][2]
    for whole in ("strain", "dissipation", "kinetic"):
        assert sum(row[whole].values()) == pytest.approx(1.0, abs=0.01)
        assert min(row[whole].values()) >= 0.001
    model = as_drawn(load_machine(drawing))
    shares = energy_shares(model, model.drawn, model_modes(model, model.drawn))
    stages = shares.by_stage(shares.strain)
    assert row["strain_by_stage"]["joint:head"] == pytest.approx(stages["joint:head"][2])
    size = 3 * 6 + 6 * 2
    assert content["shape_labels"][0] == "acc1:+tx"
    assert content["shape_labels"][-1] == "head:+rz"
    assert len(content["shape_labels"]) == len(row["shape_real"]) == size
    assert len(row["shape_imaginary"]) == size


def test_all_outputs_of_one_call_are_written(drawing, tmp_path):
    result = mbw(
        "predict", drawing, "--modes", "--frf", "--statespace", "system.npz", "--json", "all.json",
        "--out", "pictures", "--input", "acc3:+x", "--output", "acc1:+z",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    head, *rest = result.stdout.split("frequency/Hz,Re acc1:+tz / acc3:+tx")
    assert head.startswith("mode")
    assert len(rest[0].splitlines()) == 1 + 801
    for name in ("system.npz", "all.json", "pictures/predict.html"):
        assert (tmp_path / name).stat().st_size > 1000
    assert "file://" in result.stderr


def test_pictures_go_beside_the_reader_unless_unwanted(drawing, tmp_path):
    assert mbw("predict", drawing, "--no-pictures").exit_code == 0
    assert not (tmp_path / "pair-predicted").exists()
    assert mbw("predict", drawing).exit_code == 0
    assert (tmp_path / "pair-predicted" / "predict.html").is_file()


def test_a_page_replaces_the_one_before_and_nothing_else(drawing, tmp_path):
    place = tmp_path / "pair-predicted"
    place.mkdir()
    (place / "predict.html").write_text("old")
    (place / "notes.txt").write_text("mine")
    mbw("predict", drawing)
    assert (place / "predict.html").stat().st_size > 100_000
    assert sorted(path.name for path in place.iterdir()) == [
        ".mbw.json",
        "notes.txt",
        "predict.html",
    ]
    assert (place / "notes.txt").read_text() == "mine"


def test_motors_and_the_floor_are_inputs(driven):
    result = mbw(
        "predict", driven, "--frf", "--input", "drive", "--input", "floor:+tx",
        "--output", "acc1:+tx", "--band", 10, 20, "--lines", 2, "--no-pictures",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    rows = list(csv.reader(io.StringIO(result.stdout)))
    assert rows[0][1::2] == ["Re acc1:+tx / drive", "Re acc1:+tx / floor:+tx"]
    # One mass of 12 kg: s^2 3 / (12 s^2 + 100 s + 1e6), and the classical transmissibility,
    # but for the rotor, 10 mm off its axis.
    s = 2j * np.pi * 10.0
    values = np.array(rows[1][1:], float).view(complex)
    stiffness = 12 * s**2 + 100 * s + 1e6
    assert values[0] == pytest.approx(3 * s**2 / stiffness, rel=1e-3)
    assert values[1] == pytest.approx((100 * s + 1e6) / stiffness, rel=1e-3)


@pytest.mark.parametrize("quantity", ["accelerance", "receptance"])
def test_a_state_space_with_motor_and_floor_reproduces_the_frfs(driven, tmp_path, quantity):
    arguments = (
        "predict", driven, "--input", "drive", "--input", "floor:+tx", "--output", "acc1:+tx",
        "--band", 10, 20, "--lines", 2, "--no-pictures", "--quantity", quantity,
    )  # fmt: skip
    result = mbw(*arguments, "--frf", "--statespace", "system.npz")
    assert result.exit_code == 0, result.stderr
    with np.load(tmp_path / "system.npz") as file:
        system = dict(file)
    a, b, c, d = (system[name] for name in "ABCD")
    assert system["inputs"].tolist() == ["drive", "floor:+tx"]
    assert len(system["states"]) == len(a)
    assert "slide_tx'" in system["states"]
    values = c @ np.linalg.solve(2j * np.pi * 10.0 * np.eye(len(a)) - a, b) + d
    row = list(csv.reader(io.StringIO(result.stdout)))[1]
    assert values[0] == pytest.approx(np.array(row[1:], float).view(complex))


def test_a_spinning_rotor_splits_its_equal_modes(tmp_path):
    text = """<mujoco model="rotor"><option gravity="0 0 0"/><worldbody><body name="shaft">
      <inertial pos="0 0 0" mass="5" diaginertia="0.2 0.2 0.05"/>
      <joint name="shaft_rx" type="hinge" axis="1 0 0" stiffness="2e4"/>
      <joint name="shaft_ry" type="hinge" axis="0 1 0" stiffness="2e4"/>
      <body name="disc"><inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.2"/>
      <joint name="disc_rz" type="hinge" axis="0 0 1"/></body></body></worldbody></mujoco>"""
    (tmp_path / "rotor.xml").write_text(text, encoding="utf-8")
    tilting = {}
    for rate in (0, 300):
        spin = ("--spin", f"disc_rz={rate}") if rate else ()
        mbw("predict", "rotor.xml", "--json", "modes.json", "--no-pictures", *spin)
        rows = json.loads((tmp_path / "modes.json").read_text())["modes"]
        tilting[rate] = [row["frequency"] for row in rows if row["frequency"] > 1]
    assert tilting[0] == pytest.approx(2 * [np.sqrt(2e4 / 0.3) / (2 * np.pi)])
    # I w^2 -+ Iz W w - k = 0
    root = np.sqrt(60.0**2 + 4 * 0.3 * 2e4)
    expected = [(root - 60) / 0.6 / (2 * np.pi), (root + 60) / 0.6 / (2 * np.pi)]
    assert tilting[300] == pytest.approx(expected, rel=1e-6)


def test_remarks_on_the_model_are_said_on_stderr_and_in_every_record(driven, tmp_path):
    result = mbw("predict", driven, "--spin", "rotor_rz=10", "--json", "modes.json")
    assert "frozen as drawn" in result.stderr
    assert "frozen as drawn" not in result.stdout
    remarks = json.loads((tmp_path / "modes.json").read_text())["remarks"]
    assert any("frozen as drawn" in remark for remark in remarks)
    page = (tmp_path / "driven-predicted" / "predict.html").read_text(encoding="utf-8")
    assert "frozen as drawn" in page.split("<h2>")[0]


def test_an_inverted_pendulum_is_called_unstable(tmp_path):
    text = """<mujoco model="inverted"><worldbody><body name="rod">
      <inertial pos="0 0 1" mass="5" diaginertia="0.2 0.2 0.05"/>
      <joint name="rod_ry" type="hinge" axis="0 1 0"/></body></worldbody></mujoco>"""
    (tmp_path / "inverted.xml").write_text(text, encoding="utf-8")
    result = mbw("predict", "inverted.xml")
    assert result.exit_code == 0, result.stderr
    assert "Unstable" in result.stderr
    assert sum("unstable" in line for line in result.stdout.splitlines()) == 1


def test_a_keyframe_can_be_chosen(tmp_path):
    # A pendulum between magnets has another frequency where its servo holds it.
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body name="arm"><joint name="pivot" axis="0 1 0"/>'
        '<geom size="0.1" pos="0 0 -0.5" mass="2"/><site name="acc1"/></body></worldbody>'
        '<actuator><position name="hold" joint="pivot" kp="100"/></actuator><keyframe>'
        '<key name="home" qpos="1"/><key name="up" qpos="1.5" ctrl="1.5"/></keyframe></mujoco>',
        encoding="utf-8",
    )
    home, up, drawn = (
        mbw("predict", path, "--json", "-", "--no-pictures", *option)
        for option in ((), ("--key", "up"), ("--key", ""))
    )
    frequency = [json.loads(run.stdout)["modes"][0]["frequency"] for run in (home, up, drawn)]
    assert frequency[0] == pytest.approx(frequency[2], rel=1e-9)  # both hang straight down
    assert frequency[1] < 0.99 * frequency[0]
    assert "Keyframe 'home' gives pose and controls." in home.stderr
    assert "of which none is used" in drawn.stderr
    wrong = mbw("predict", path, "--key", "down")
    assert wrong.exit_code == 3
    assert "has no keyframe 'down': choose one of home, up" in wrong.stderr


def test_the_usual_band_of_a_free_axis_begins_above_0_hz(driven):
    ports = ("--frf", "--input", "joint:slide_ty", "--output", "joint:slide_ty")
    result = mbw("predict", driven, *ports)
    assert result.exit_code == 0, result.output
    first = [float(text) for text in result.stdout.splitlines()[1].split(",")]
    assert first[0] == 0.25
    assert first[1] == pytest.approx(-1 / (12 * (2 * np.pi * 0.25) ** 2), rel=1e-6)
    refused = mbw("predict", driven, *ports, "--band", 0, 100)
    assert refused.exit_code == 2
    assert "start the band above it" in refused.stderr
