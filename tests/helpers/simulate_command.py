"""Runs of ``mbw simulate`` on the model of two bodies."""

from pathlib import Path

from small_machine import MJCF
from typer.testing import CliRunner

from mbw.command import app

_RUNNER = CliRunner()


def run(*arguments: object, code: int = 0) -> str:
    """Return the output of the command on one line; it must end with the exit code."""
    result = _RUNNER.invoke(app, ["simulate", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


def write_pair_model(folder: Path) -> Path:
    """Write the model of two bodies; return its file."""
    path = folder / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path
