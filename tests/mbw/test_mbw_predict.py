"""``mbw predict`` in-process."""

import csv
import io
import json

import numpy as np
import pytest
import scipy.io
from small_machine import MJCF
from typer.testing import CliRunner

from identification.words import Dof
from mbmodel import Evaluator, Question, as_drawn, load_machine, modes
from mbw.command import app

RUNNER = CliRunner()


@pytest.fixture
def drawing(tmp_path):
    path = tmp_path / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path


def mbw(*arguments):
    return RUNNER.invoke(app, [str(argument) for argument in arguments])


def test_modes_are_printed_and_written_as_json(drawing, tmp_path):
    result = mbw("predict", drawing, "--json", tmp_path / "modes.json")
    assert result.exit_code == 0
    found = modes(as_drawn(load_machine(drawing)).matrices(as_drawn(load_machine(drawing)).drawn))
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
    question = Question(
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
    question = Question(np.array([33.0]), (Dof("acc1", "+tz"),), (Dof("acc3", "+tx"),))
    assert value[0, 0] == pytest.approx(Evaluator(model, question).at(model.drawn).values[0, 0, 0])


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("--frf", "--output", "nowhere:+tx"), 2, "nowhere"),
        (("--frf", "--output", "acc1"), 2, "label"),
        (("--frf", "--band", "90", "10"), 2, "90"),
        (("--frf", "--quantity", "inertance"), 2, "inertance"),
        (("--statespace", "system.txt"), 2, ".npz"),
    ],
)
def test_questions_without_sense_exit_2(drawing, arguments, code, words):
    result = mbw("predict", drawing, *arguments)
    assert result.exit_code == code
    assert words in result.stderr


def test_a_missing_model_exits_3(tmp_path):
    result = mbw("predict", tmp_path / "none.xml")
    assert result.exit_code == 3
    assert "does not exist" in result.stderr
