"""The wheel, installed into an empty environment: types of the public face hold for its users."""

import re
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README_CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """An environment with the wheel; what it depends on is read from this one, not the clone."""
    place = tmp_path_factory.mktemp("environment")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", place, ROOT]
    subprocess.run(build, check=True, capture_output=True, timeout=120)
    (wheel,) = place.glob("mbworkbench-*.whl")
    venv.create(place / "venv", with_pip=False, symlinks=True)
    (site,) = (place / "venv" / "lib").glob("python*/site-packages")
    # A folder named in a .pth file is searched, but its own .pth files are not: not the clone.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site]
    subprocess.run([*install, wheel], check=True, capture_output=True, timeout=120)
    return place / "venv" / "bin" / "python"


def _mypy(environment, folder, code):
    script = folder / "script.py"
    script.write_text(code)
    cache = environment.parent / "mypy_cache"  # for all calls
    call = ["-m", "mypy", "--strict", "--cache-dir", cache, "--python-executable", environment]
    return subprocess.run(
        [sys.executable, *map(str, call), script],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_readmes_python_passes_mypy_strict(environment, tmp_path):
    (code,) = README_CODE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    done = _mypy(environment, tmp_path, code)
    assert done.returncode == 0, done.stdout


def test_a_wrong_call_is_found_by_mypy(environment, tmp_path):
    code = 'import mbworkbench as mb\n\nmb.read_campaign("demo").no_such\nmb.tune(3)\n'
    done = _mypy(environment, tmp_path, code)
    assert "no_such" in done.stdout
    assert 'Argument 1 to "tune"' in done.stdout


def test_every_package_of_the_wheel_is_typed_and_is_not_the_clone(environment, tmp_path):
    code = (
        "import importlib.util as u, pathlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    place = pathlib.Path(u.find_spec(name).origin).parent\n"
        "    assert (place / 'py.typed').is_file() and sys.prefix in str(place), place\n"
    )
    names = ["identification", "mbmodel", "tuning", "diagnosis", "truth", "mbw", "mbworkbench"]
    done = subprocess.run(
        [environment, "-I", "-c", code, *names],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_the_gallery_opens_from_the_wheel(environment, tmp_path):
    code = (
        "import sys\n"
        "from mbw.gallery import find_part\n"
        "from mbw.workbench.opening import open_subject\n"
        "folder = find_part('servo-axis', 'diagnosed')\n"
        "assert sys.prefix in str(folder), folder\n"
        "print(open_subject(folder, None, None).verdict.diagnosis.verdict.causes[0].effect)\n"
    )
    done = subprocess.run(
        [environment, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "inertance", done.stderr
