"""The house's one-way streets, walked in the source."""

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import pytest

ROOT = Path(__file__).resolve().parent.parent
MAY_IMPORT = {
    "identification.words": set(),
    "identification": {"identification.words"},
    "mbmodel": {"identification.words"},
    "tuning": {"identification.words", "identification", "mbmodel"},
    "diagnosis": {"identification.words", "identification", "mbmodel", "tuning"},
    "truth": set(),
    "mbw": {"identification.words", "identification", "mbmodel", "tuning", "diagnosis", "truth"},
    "mbworkbench": {"identification.words", "identification", "mbmodel", "tuning", "diagnosis"},
    "gapbench": {"gapbench.draw"},  # in a function; and nothing of a diagnosis anywhere
    "gapbench.draw": {"truth", "gapbench"},
    "gapbench.baselines": {"truth", "gapbench", "identification.words", "mbmodel", "tuning"},
    "gapbench.examples": {"truth"},
}
ONLY_BEHIND = {
    "mujoco": {"mbmodel", "truth/machine"},
    "nlopt": {"tuning/solvers/nlopt_solver.py"},
    "meshio": {"mbmodel/meshes/files.py", "identification/shapes/fe_mesh_child.py"},
    "h5py": {
        "identification/readers/matlab73_child.py",
        "identification/shapes/fe_mesh_child.py",
    },
    "plotly": {"mbw/page/html.py", "mbworkbench/plots.py"},
    "typer": {"mbw", "truth"},
    "rich": {"mbw"},
    "PIL": {"mbw/animation"},
    "truth": {"truth", "mbw/blind", "gapbench/draw.py", "gapbench/baselines", "gapbench/examples"},
}
PACKAGES = sorted({name.split(".")[0] for name in MAY_IMPORT})
SHOWS_OTHER_VERBS = {"report", "demo", "blind", "compare", "open", "workbench"}
WORDS_MAY_IMPORT = {"numpy", "identification"}


def _room(module: str) -> str | None:
    for room in sorted(MAY_IMPORT, key=len, reverse=True):
        if module == room or module.startswith(room + "."):
            return room
    return None


def _imports(path: Path) -> list[str]:
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.append(node.module)
    return names


def _files() -> list[Path]:
    return sorted(f for package in PACKAGES for f in (ROOT / package).rglob("*.py"))


def _faults(path: Path, imports: list[str]) -> list[str]:
    relative = path.relative_to(ROOT)
    room = _room(".".join(relative.with_suffix("").parts))
    faults = []
    for name in imports:
        target = _room(name)
        if target is not None and target != room and target not in MAY_IMPORT[room]:
            faults.append(f"{relative} imports {name}")
        homes = ONLY_BEHIND.get(name.split(".")[0])
        if homes and not any(relative.is_relative_to(home) for home in homes):
            faults.append(f"{relative} imports {name}, which lives in {', '.join(homes)}")
    return faults


@pytest.mark.parametrize("path", _files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_imports_only_what_its_room_may(path):
    assert _faults(path, _imports(path)) == []


def _rooms(root: Path, folder: str) -> dict[str, set[str]]:
    """Return which other rooms of a folder each room imports: subfolders, modules, __init__."""
    there = {path.stem for path in (root / folder).iterdir()}
    rooms: dict[str, set[str]] = {}
    for path in sorted((root / folder).rglob("*.py")):
        names = {
            f"{node.module}.{alias.name}" if isinstance(node, ast.ImportFrom) else alias.name
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Import | ast.ImportFrom)
            for alias in node.names
        }
        inside = f"{folder.replace('/', '.')}."
        first = {
            f"{name}.".removeprefix(inside).split(".")[0]
            for name in names
            if f"{name}.".startswith(inside)
        }
        imported = {name if name in there else "__init__" for name in first}
        room = path.relative_to(root / folder).with_suffix("").parts[0]
        rooms[room] = rooms.get(room, set()) | imported - {room}
    return rooms


def _circle(root: Path, folder: str) -> list[str]:
    """Return rooms that import one another in a circle; none if all imports go one way."""
    try:
        TopologicalSorter(_rooms(root, folder)).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


@pytest.mark.parametrize("folder", [*PACKAGES, "tuning/plant"])
def test_the_rooms_of_a_package_import_one_another_one_way(folder):
    assert not _circle(ROOT, folder)


def test_verbs_and_what_they_share_import_no_verb():
    verbs = {path.parent.name for path in (ROOT / "mbw").glob("*/options.py")}
    rooms = _rooms(ROOT, "mbw")
    for room in rooms.keys() - SHOWS_OTHER_VERBS:
        assert not rooms[room] & verbs, room


@pytest.mark.parametrize("back", ["from house.hall.door import open", "import house", ""])
def test_a_circle_is_found(tmp_path, back):
    for room in ("hall", "stairs"):
        (tmp_path / "house" / room).mkdir(parents=True)
    (tmp_path / "house/__init__.py").write_text("from house.stairs.step import climb")
    (tmp_path / "house/hall/door.py").write_text("from house.stairs import step")
    (tmp_path / "house/stairs/step.py").write_text(back)
    assert bool(_circle(tmp_path, "house")) == bool(back)


def test_the_words_need_numpy_only():
    for path in sorted((ROOT / "identification" / "words").rglob("*.py")):
        foreign = {
            name.split(".")[0]
            for name in _imports(path)
            if name.split(".")[0] not in WORDS_MAY_IMPORT
        }
        assert foreign <= sys.stdlib_module_names, path


def test_a_wrong_import_is_found():
    assert _faults(ROOT / "truth" / "station.py", ["mbmodel.machine"])
    assert _faults(ROOT / "mbmodel" / "machine.py", ["identification.uff"])
    assert _faults(ROOT / "tuning" / "fit.py", ["nlopt"])


# Each costs every command most of a second to load, and few commands need it.
SLOW = {"control", "scipy.signal", "gapbench.draw"}


def test_no_import_stands_inside_a_function_but_of_what_is_slow_to_load():
    for path in _files():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
                inside = {
                    alias.name if isinstance(node, ast.Import) else node.module
                    for node in ast.walk(function)
                    if isinstance(node, ast.Import | ast.ImportFrom)
                    for alias in node.names
                }
                assert inside <= SLOW, f"{path}: {function.name}"


@pytest.mark.parametrize("package", PACKAGES)
def test_a_module_has_every_name_that_it_exports(package):
    modules = [package, *(i.name for i in walk_packages([str(ROOT / package)], f"{package}."))]
    for name in modules:
        if name.endswith("__main__"):
            continue
        module = import_module(name)
        lacking = [each for each in getattr(module, "__all__", ()) if not hasattr(module, each)]
        assert not lacking, name
