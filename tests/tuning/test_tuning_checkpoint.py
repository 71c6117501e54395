"""Checkpoints that were altered, cut or are no files: refused, never used with other numbers."""

import json
import os

import numpy as np
import pytest

from identification.words import InputError
from tuning.fitting.checkpoint import Checkpoint
from tuning.solvers.nlopt_solver import Minimum

STEPS = ("start 0, stage 0", "start 0, stage 1", "fold 3")


def numbers():
    rng = np.random.default_rng(39_001)
    return {name: rng.normal(size=4) * 10.0 ** rng.integers(-9, 9, 4) for name in STEPS}


@pytest.fixture
def file(tmp_path):
    checkpoint = Checkpoint(tmp_path / "kept.json", "of these inputs")
    for name, x in numbers().items():
        checkpoint.keep(name, Minimum(x, 1.25, 17, "converged", "it's fine"))
    return tmp_path / "kept.json"


def resumed(file):
    checkpoint = Checkpoint(file, "of these inputs", resume=True)
    return {name: checkpoint.recall(name) for name in STEPS}


def test_steps_read_back_to_the_last_bit(file):
    for name, end in resumed(file).items():
        assert np.array_equal(end.x, numbers()[name])
        assert (end.value, end.evaluations, end.outcome) == (1.25, 17, "converged")
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_an_altered_checkpoint_is_refused_or_holds_the_same_numbers(file):
    whole, rng = file.read_bytes(), np.random.default_rng(39_002)
    refused = 0
    for _ in range(400):
        content = bytearray(whole)
        place = int(rng.integers(len(content)))
        kind = rng.integers(4)
        if kind == 0:
            content[place] = int(rng.integers(256))
        elif kind == 1:
            del content[place : place + int(rng.integers(1, 40))]
        elif kind == 2:
            content[place:place] = rng.choice([b"x", b"9", b"-", b"[", b"null", b"\0", b'"', b","])
        else:
            del content[place:]
        file.write_bytes(content)
        try:
            ends = resumed(file)
        except InputError:
            refused += 1
        else:
            assert all(np.array_equal(ends[name].x, numbers()[name]) for name in STEPS)
    assert refused > 380


@pytest.mark.parametrize("key", ["x", "value", "evaluations", "outcome", "step", "checksum"])
def test_other_numbers_in_the_right_form_are_refused(file, key):
    content = json.loads(file.read_text())
    step = content["steps"][STEPS[0]]
    if key == "x":
        step["x"] = [2 * value for value in step["x"]]
    elif key == "step":
        del content["steps"][STEPS[0]]
    elif key == "checksum":
        content = {name: content[name] for name in ("fingerprint", "steps")}
    else:
        step[key] = {"value": 0.1, "evaluations": 18, "outcome": "failed"}[key]
    file.write_text(json.dumps(content))
    with pytest.raises(InputError, match="was altered since it was written: remove it"):
        resumed(file)


@pytest.mark.parametrize("content", ["[" * 100_000, '{"steps": ' + "9" * 5000 + "}", "[]", ""])
def test_what_json_cannot_hold_is_refused(file, content):
    file.write_text(content)
    with pytest.raises(InputError, match="cannot be read"):
        resumed(file)


def test_a_folder_or_a_pipe_is_no_checkpoint(tmp_path):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("folder", "pipe"):
        with pytest.raises(
            InputError, match=f"{name} is a .*, a file of this name does not exist: remove it"
        ):
            resumed(tmp_path / name)


def test_a_full_disk_leaves_the_old_steps_and_one_sentence(file, monkeypatch):
    before = file.read_bytes()
    checkpoint = Checkpoint(file, "of these inputs", resume=True)

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(
        InputError, match=r"kept.json cannot be written \(No space left on device\)"
    ):
        checkpoint.keep("fold 4", Minimum(np.ones(2), 1.0, 1, "converged", ""))
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == [file.name]
