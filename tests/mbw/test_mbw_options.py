"""Options of the verbs: the common ones are everywhere, and messages name only those that exist."""

import ast
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
import typer
from campaign_folder import write_folder
from small_machine import MJCF
from typer.testing import CliRunner

from mbw.command import VERBS, app
from mbw.loader import fill_arguments

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("identification", "mbmodel", "tuning", "diagnosis", "mbw", "mbworkbench")
COMMON = {"--out", "--json", "--jobs", "--quiet", "--overwrite"}
SHAPES = ROOT / "assets" / "gondola" / "shapes.vtu"
WITHOUT_BAND = {"report", "view", "blind merge", "models"}
WITHOUT_JOBS = {"blind merge"}  # it computes nothing
WITH_SEED = {"demo", "tune", "diagnose", "blind", "simulate", "predict", "excite"}
OF_OTHER_PROGRAMS = {"--nthreads"}  # of Dask's workers


def options(verb):
    group = typer.main.get_command(app)
    context = group.make_context("mbw", [], resilient_parsing=True)
    return {
        name
        for parameter in group.get_command(context, verb).params
        for name in (*parameter.opts, *parameter.secondary_opts)
        if name.startswith("--")
    }


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_takes_the_common_options(verb):
    known = options(verb)
    assert known >= COMMON - ({"--jobs"} if verb in WITHOUT_JOBS else set())
    assert ("--band" in known) == (verb not in WITHOUT_BAND)
    assert ("--seed" in known) == (verb in WITH_SEED)


def option_words():
    """File and line of every option that a text of the packages names, docstrings too."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    for word in re.findall(r"(?<![\w-])--[a-z][a-z-]*", node.value):
                        yield f"{path.relative_to(ROOT)}:{node.lineno}", word


def test_texts_name_only_options_that_a_verb_has():
    general = {"--debug", "--version", "--help"}
    known = general.union(OF_OTHER_PROGRAMS, *(options(verb) for verb in VERBS))
    named = list(option_words())
    assert len(named) > 40
    assert [(place, word) for place, word in named if word not in known] == []


def test_a_verb_named_beside_an_option_has_it():
    """Texts such as ``mbw tune CAMPAIGN --resume``: the option belongs to that verb."""
    pattern = re.compile(r"\bmbw (\w+)((?:\s+(?:[A-Z]+\b|<\w+>|--[a-z-]+))+)")
    pages = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "mbw").rglob("*.py"), ROOT / "README.md"]
    checked = 0
    for page in pages:
        for verb, words in pattern.findall(page.read_text("utf-8")):
            for word in re.findall(r"--[a-z-]+", words) if verb in VERBS else ():
                checked += 1
                assert word in options(verb) | {"--help"}, f"{page}: mbw {verb} {word}"
    assert checked > 3


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    place = tmp_path_factory.mktemp("sources")
    model = place / "pair.xml"
    model.write_text(MJCF, encoding="utf-8")
    return {"identify": write_folder(place / "campaign"), "predict": model, "place": SHAPES}


@pytest.mark.parametrize("verb", ["identify", "predict", "place"])
def test_quiet_with_json_on_stdout_prints_json_alone(sources, verb, tmp_path):
    out = tmp_path / "out"
    words = [verb, str(sources[verb]), "--quiet", "--json", "-", "--out", str(out), "--overwrite"]
    for arguments in (words, [*words, "--jobs", "2", "--band", "10", "90"]):
        done = CliRunner().invoke(app, arguments)
        assert (done.exit_code, done.stderr) == (0, "")
        assert json.loads(done.stdout)
    assert any(out.iterdir())
    silent = CliRunner().invoke(app, [verb, str(sources[verb]), "-q", "--out", str(out)])
    assert (silent.exit_code, silent.output) == (0, "")


def test_a_report_hands_out_the_json_of_its_result(sources, tmp_path):
    out = str(tmp_path / "out")
    assert CliRunner().invoke(app, ["identify", str(sources["identify"]), "--out", out, "-q"])
    done = CliRunner().invoke(app, ["report", out, "--json", "-", "-q"])
    assert done.exit_code == 0
    assert json.loads(done.stdout) == json.loads((tmp_path / "out" / "modes.json").read_text())
    assert CliRunner().invoke(app, ["report", out, "--seed", "1"]).exit_code == 2


def test_places_go_into_a_folder_or_a_file(tmp_path):
    words = ["place", str(SHAPES), "--band", "15", "95", "--channels", "12", "-q", "--out"]
    assert CliRunner().invoke(app, [*words, str(tmp_path / "folder")]).exit_code == 0
    assert CliRunner().invoke(app, [*words, str(tmp_path / "mine.csv")]).exit_code == 0
    assert (tmp_path / "folder" / "sites.csv").read_bytes() == (tmp_path / "mine.csv").read_bytes()


def test_more_frequency_lines_than_memory_holds_are_refused(tmp_path):
    (tmp_path / "model.xml").write_text(MJCF)
    run = CliRunner().invoke(app, ["predict", str(tmp_path / "model.xml"), "--lines", "1000000000"])
    assert run.exit_code == 2
    assert "--lines" in run.stderr


@dataclass(frozen=True)
class Place:
    out: Path | None = None
    names: Sequence[str] = ()


def take(source: Path, place: Place, *, words: list[str], jobs: int = 1) -> None:
    """Take two options and a record of two."""


def test_options_of_the_names_of_its_fields_make_a_record():
    options = {"source": Path("a"), "out": Path("b"), "names": None, "words": None}
    assert fill_arguments(take, options) == {
        "source": Path("a"),
        "place": Place(Path("b"), []),
        "words": [],
    }


def test_an_option_that_a_verb_does_not_take_is_no_silent_loss():
    with pytest.raises(TypeError, match=r"take takes no speed$"):
        fill_arguments(take, {"source": Path("a"), "words": None, "speed": 1.0})
