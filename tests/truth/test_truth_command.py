"""The command, run in this process: exit codes, messages, files."""

import hashlib

import pytest
from typer.testing import CliRunner

from truth.__main__ import app


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_it_writes_a_campaign_and_publishes_the_answers_hash_first(nominal_path, tmp_path):
    result = run(nominal_path, tmp_path / "out", "--seed", 5, "--effect", "appendage")
    assert result.exit_code == 0
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["answer.toml", "campaign.toml", "impact_200N.uff", "meshes", "model.xml"]
    answer = (tmp_path / "out" / "answer.toml").read_bytes()
    assert hashlib.sha256(answer).hexdigest() in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--effect", "rust"], "'rust' is unknown"),
        (["--effect", "appendage", "--place", "body:lid"], "'lid' is unknown"),
        (["--place", "body:ty"], "leave it out"),
        (["--node", 99], "acc99"),
        (["--level", -3], "peak force"),
    ],
)
def test_bad_input_ends_with_three_a_sentence_and_no_file(nominal_path, tmp_path, options, words):
    result = run(nominal_path, tmp_path / "out", "--seed", 5, *options)
    assert result.exit_code == 3
    assert words in result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_existing_campaign_needs_the_word(nominal_path, tmp_path):
    (tmp_path / "campaign.toml").touch()
    refused = run(nominal_path, tmp_path, "--seed", 5)
    assert refused.exit_code == 3
    assert "sha256" not in refused.stderr
    assert run(nominal_path, tmp_path, "--seed", 5, "--overwrite").exit_code == 0
    assert (tmp_path / "model.xml").exists()


def test_a_missing_model_ends_with_three(tmp_path):
    result = run(tmp_path / "no.xml", tmp_path / "out", "--seed", 5)
    assert result.exit_code == 3
    assert "cannot be read" in result.stderr


def test_a_place_that_cannot_be_written_ends_with_three(nominal_path, tmp_path):
    (tmp_path / "file").touch()
    result = run(nominal_path, tmp_path / "file" / "out", "--seed", 5)
    assert result.exit_code == 3
    assert "Traceback" not in result.stderr


def test_a_wrong_use_ends_with_two(nominal_path, tmp_path):
    assert run(nominal_path, tmp_path / "out").exit_code == 2
    assert run(nominal_path, tmp_path / "out", "--seed", -1).exit_code == 2
    assert run(nominal_path, tmp_path / "out", "--seed", 1, "--averages", 1).exit_code == 2
