"""The project's language, as far as a syntax tree can show it."""

import ast
import tomllib
from functools import cache
from pathlib import Path

import pytest

from tests.language.rules import (
    PACKAGES,
    ROOT,
    Violation,
    check_exports,
    check_package,
    check_together,
    check_tree,
    count_repeated_entries,
    excepted,
    is_participle,
    long_sentences,
    parse_package,
)

EXCEPTIONS = tomllib.loads((Path(__file__).parent / "exceptions.toml").read_text("utf-8"))[
    "exception"
]
MOST_EXCEPTIONS = 20
MOST_REPEATED_ENTRIES = 700
TEXTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


@cache
def violations_together():
    return check_together({k: v for name in PACKAGES for k, v in parse_package(name).items()})


@pytest.mark.parametrize("package", PACKAGES)
def test_names_and_docstrings_follow_the_language(package):
    violations = [*check_package(package), *check_exports(package)]
    assert [str(v) for v in violations if not excepted(v, EXCEPTIONS)] == []


def test_no_constant_and_no_class_has_two_meanings():
    violations = violations_together()
    assert [str(v) for v in violations if not excepted(v, EXCEPTIONS)] == []


def test_few_entries_of_docstrings_stand_twice():
    trees = [tree for name in PACKAGES for tree in parse_package(name).values()]
    assert count_repeated_entries(trees) <= MOST_REPEATED_ENTRIES


def test_entries_that_stand_twice_are_counted():
    entries = "x: [m]\n            or [rad].\n        y: {}."
    source = f'def f(x, y):\n    """Return.\n\n    Args:\n        {entries}\n    """\n'
    trees = [ast.parse(source.format(word)) for word in ("one", "another", "one")]
    assert count_repeated_entries(trees) == 3


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_sentence_of_the_docs_is_too_long(path):
    assert list(long_sentences(path.read_text(encoding="utf-8"))) == []


def test_exceptions_are_few_have_reasons_and_are_needed():
    assert len(EXCEPTIONS) <= MOST_EXCEPTIONS
    violations = [v for name in PACKAGES for v in (*check_package(name), *check_exports(name))]
    violations += violations_together()
    for entry in EXCEPTIONS:
        assert len(entry["reason"].split()) >= 4
        assert any(excepted(violation, [entry]) for violation in violations), entry


def test_each_rule_finds_what_it_refuses():
    source = '''
def asked(own):
    """The same, asked again."""
    for one in own:
        found = one
    return found


class Row:
    made: int
'''
    violations = check_tree("mbmodel/looks.py", ast.parse(source))
    assert {(v.rule, v.name) for v in violations} == {
        ("file name", "looks"),
        ("pronoun", "own"),
        ("pronoun", "one"),
        ("pronoun", "found"),
        ("pronoun", "made"),
        ("participle", "asked"),
        ("docstring", "asked"),
    }


@pytest.mark.parametrize(
    "source",
    [
        "import numpy as found",
        "from numpy import array as one",
        "try: pass\nexcept OSError as other: pass",
        "match 1:\n    case int() as other: pass",
        "match []:\n    case [*others]: pass",
        "self.own = 1",
        "_found = 1",
        "def own(): pass",
        "async def f(one): pass",
        "class one: pass",
        "(lambda one: one)",
        "[one for one in ()]",
        "if (found := 1): pass",
        "asked = lambda: 1",
        "async def chosen(): pass",
    ],
)
def test_no_way_to_bind_a_refused_name_slips_through(source):
    assert check_tree("mbmodel/frf/solver.py", ast.parse(source))


def test_a_private_constant_under_a_condition_counts():
    first = ast.parse("if True:\n    _LEAST = 1\n")
    trees = {ROOT / "a.py": first, ROOT / "b.py": ast.parse("_LEAST, _MOST = 1, 2\n")}
    assert {v.name for v in check_together(trees)} == {"_LEAST"}


def test_one_name_in_two_files_is_found():
    first = ast.parse("_LEAST = 1\nclass Level: ...\n")
    second = ast.parse("_LEAST: int = 2\nclass Level: ...\n")
    trees = {ROOT / "a" / "first.py": first, ROOT / "b" / "second.py": second}
    assert {(v.rule, v.name) for v in check_together(trees)} == {
        ("constant twice", "_LEAST"),
        ("class twice", "Level"),
    }


def test_a_module_with_the_name_of_an_exported_function_is_found(tmp_path, monkeypatch):
    package = tmp_path / "mbmodel"
    package.mkdir()
    (package / "__init__.py").write_text("from mbmodel.energy import energy\n")
    (package / "energy.py").write_text("def energy(): ...\n")
    monkeypatch.setattr("tests.language.rules.ROOT", tmp_path)
    assert [v.name for v in check_exports("mbmodel")] == ["energy"]


@pytest.mark.parametrize("name", ["asked", "_begun", "merged", "drawn", "foretold"])
def test_a_bare_participle_is_found(name):
    assert is_participle(name)


@pytest.mark.parametrize("name", ["ask", "need", "merge_surfaces", "read_only", "seed"])
def test_verbs_and_nouns_are_no_participles(name):
    assert not is_participle(name)


def test_a_long_sentence_is_found_and_code_and_tables_do_not_count():
    long = " ".join(["word"] * 36) + "."
    assert list(long_sentences(long)) == [long]
    assert list(long_sentences(f"```\n{long}\n```\n\n| {long} |\n\n# {long}\n")) == []
    assert (
        list(long_sentences("- " + " ".join(["word"] * 30) + "\n- " + " ".join(["a"] * 30))) == []
    )


def test_an_exception_holds_for_its_rule_file_and_name_alone():
    entry = {"rule": "pronoun", "path": "diagnosis/*, truth/*", "name": "one, made"}
    assert excepted(Violation("pronoun", "diagnosis/search.py", "one"), [entry])
    assert excepted(Violation("pronoun", "truth/search.py", "made"), [entry])
    assert not excepted(Violation("pronoun", "diagnosis/search.py", "own"), [entry])
    assert not excepted(Violation("pronoun", "tuning/search.py", "one"), [entry])
