"""The twin is independent: it shares no code with what it judges."""

import ast
import sys
from pathlib import Path

import truth

# MuJoCo itself reads machines and gives their forces; no code of the project does.
ALLOWED = {"truth", "mujoco", "numpy", "scipy", "threadpoolctl", "typer"} | set(
    sys.stdlib_module_names
)


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names.add(str(node.module).partition(".")[0])
    return names


def test_it_imports_nothing_of_the_project():
    files = list(Path(str(truth.__file__)).parent.rglob("*.py"))
    assert len(files) > 10
    for path in files:
        assert imported(path) <= ALLOWED, path.name
