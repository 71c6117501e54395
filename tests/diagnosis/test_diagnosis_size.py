"""The diagnosis stays readable: short files, few constants, one algorithm that fits on a page."""

import ast
from dataclasses import fields
from pathlib import Path

import pytest

import diagnosis
from diagnosis.settings import SETTINGS, DiagnosisSettings
from tests.bench.ablation import KEPT, RUNGS

ROOM = Path(diagnosis.__file__).parent
MOST_CONSTANTS = 18  # module-level numeric constants: units, scans and roundings
MOST_CONSTANTS_AND_SETTINGS = 48
# Floats of formulas: halves, a quantile of 95 %.
PLAIN_FLOATS = {0.0, 0.5, 1.0, 2.0, 0.975}


@pytest.mark.parametrize("file", sorted(ROOM.rglob("*.py")), ids=lambda file: file.name)
def test_a_file_has_at_most_250_lines(file):
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 250


def test_the_algorithm_is_ten_sentences():
    text = diagnosis.diagnose.__doc__ or ""
    assert [f"{number}. " in text for number in range(1, 11)] == [True] * 10


def numeric_constants(tree):
    """Names of module-level constants whose value contains a number that is not an index."""
    for statement in tree.body:
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        names = [
            node.id
            for target in targets
            for node in ast.walk(target)
            if isinstance(node, ast.Name) and node.id.isupper()
        ]
        indices = {
            id(node)
            for part in ast.walk(statement.value)
            if isinstance(part, ast.Subscript)
            for node in ast.walk(part.slice)
        }
        if any(is_number(node) and id(node) not in indices for node in ast.walk(statement.value)):
            yield from names


def is_number(node):
    """Whether a node is a number, and no flag."""
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def all_trees():
    return {file: ast.parse(file.read_text("utf-8")) for file in sorted(ROOM.rglob("*.py"))}


def test_numeric_constants_are_few():
    constants = [name for tree in all_trees().values() for name in numeric_constants(tree)]
    assert len(constants) <= MOST_CONSTANTS, constants
    assert len(constants) + len(fields(DiagnosisSettings)) <= MOST_CONSTANTS_AND_SETTINGS


def test_no_function_hides_a_threshold():
    hidden = [
        f"{file.name}:{node.lineno}: {node.value}"
        for file, tree in all_trees().items()
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.Lambda)
        for node in ast.walk(function)
        if is_number(node) and isinstance(node.value, float) and node.value not in PLAIN_FLOATS
    ]
    assert hidden == []


def test_each_setting_has_an_ablation_or_a_reason():
    names = {field.name for field in fields(DiagnosisSettings)}
    changed = {
        name
        for settings in RUNGS.values()
        for name in names
        if getattr(settings, name) != getattr(SETTINGS, name)
    }
    assert changed | set(KEPT) == names
    assert changed.isdisjoint(KEPT)


def test_constants_are_counted_wherever_they_stand():
    source = (
        "A = 1\nB, C = 1, 2\nD: int = 3\nE = STAGES[2].floor\nF = True\ng = 4\nH = {'a': 0.5}\n"
    )
    assert list(numeric_constants(ast.parse(source))) == ["A", "B", "C", "D", "H"]
