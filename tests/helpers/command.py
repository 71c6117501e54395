"""Calls of ``mbw`` in this process."""

from click.testing import Result
from typer.testing import CliRunner

from mbw.command import app


def invoke(*words: object) -> Result:
    """Return the outcome of a call, such as ``invoke("tune", folder)``."""
    return CliRunner().invoke(app, [str(word) for word in words])


def run(*words: object, code: int = 0) -> str:
    """Return the output of a call on one line; it must end with the exit code."""
    result = invoke(*words)
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())
