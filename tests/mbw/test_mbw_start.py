"""Start of the command: time of answers without a computation, and modules that they load."""

import inspect
import json
import resource
import subprocess
import sys

import numpy as np
import pytest

from identification.modal import ModeCriteria
from mbw.command import VERBS
from mbw.identify.options import identify
from mbw.tune.options import tune
from tuning import TUNING_ALGORITHM

# A command of typer alone: what this loads, the options of a verb may load too.
TYPER = """
import json, sys
from pathlib import Path
import typer
app = typer.Typer(rich_markup_mode=None)
@app.command()
def verb(folder: Path, number: int = 1, quiet: bool = False) -> None: ...
try:
    app(["folder", "--number", "2"])
except SystemExit:
    print(json.dumps(sorted(name.split(".")[0] for name in sys.modules)))
"""
CALLS = (["--help"], ["--version"], ["tune", "--bnad"], ["tune", "--help"], ["tnue"])
RUN = """
import json, sys
from mbw.command import main
sys.argv = ["mbw", *json.loads(sys.argv[1])]
try:
    main()
except SystemExit as end:
    print(json.dumps([end.code, sorted(name.split(".")[0] for name in sys.modules)]))
"""
SLOWEST = 3.0  # times the start of an interpreter that imports typer
ROUNDS = 7


def called(arguments):
    done = subprocess.run(
        [sys.executable, "-c", RUN, json.dumps(arguments)],
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1]), done


def seconds(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *command], capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.fixture(scope="module")
def light():
    """Modules that a command of typer alone loads; they depend on typer's version."""
    done = subprocess.run([sys.executable, "-c", TYPER], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("arguments", CALLS, ids=" ".join)
def test_help_and_usage_errors_load_typer_and_the_standard_library_alone(arguments, light):
    (code, loaded), _ = called(arguments)
    assert code == (2 if "--bnad" in arguments or "tnue" in arguments else 0)
    assert "numpy" not in loaded
    foreign = set(loaded) - set(sys.stdlib_module_names) - light - {"mbw", "__main__"}
    assert {name for name in foreign if not name.startswith("_")} <= {"distutils-precedence"}


def test_every_verb_shows_its_help():
    for verb in VERBS:
        (code, loaded), done = called([verb, "--help"])
        assert code == 0
        assert "numpy" not in loaded
        assert f"mbw {verb}" in done.stdout


def test_a_misspelt_verb_is_answered_with_a_similar_one():
    _, done = called(["tnue"])
    assert "there is no verb 'tnue': did you mean tune?" in " ".join(done.stderr.split())


def test_a_misspelt_option_is_answered_with_a_similar_one():
    _, done = called(["tune", "--bnad"])
    assert "--band" in done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["tune", "--bnad"]])
def test_the_command_starts_within_three_times_the_import_of_typer(arguments):
    imports, calls = [], []
    for _ in range(ROUNDS):
        imports.append(seconds("-c", "import typer"))
        calls.append(seconds("-m", "mbw", *arguments))
    assert min(calls) < SLOWEST * min(imports)


def test_defaults_in_the_options_are_those_of_the_code():
    # Option modules must not import the code, so they repeat its defaults.
    defaults = {name: p.default for name, p in inspect.signature(identify).parameters.items()}
    for name, value in vars(ModeCriteria()).items():
        factor = {"highest_damping": 100.0, "phase_deviation": 180 / np.pi}.get(name, 1.0)
        assert defaults[name] == factor * value
    assert inspect.signature(tune).parameters["algorithm"].default == TUNING_ALGORITHM
