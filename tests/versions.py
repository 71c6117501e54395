"""``make versions``: wheel and sdist in empty environments outside the repository.

Both are built, installed with all they depend on into new environments, and tried there. Each
Python that is at hand gets the wheel and tries ``mbw --version``, README's Python and the beginning
of ``mbw demo``; the oldest one gets the sdist too, and imports it. Pythons are those on the path
and those of pyenv; each that is missing is said.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHONS = ("3.11", "3.12", "3.13")
SECOND_STEP = "2. "  # begins a line of the demo, whose steps are those of README's Python
README_CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def main() -> int:
    """Try all Pythons that are at hand; return 0 if there is one and all do."""
    (code,) = README_CODE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    at_hand = {version: python for version in PYTHONS if (python := _find(version))}
    for version in PYTHONS:
        if version not in at_hand:
            print(f"Python {version} is missing here: it is not tried", flush=True)
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        _run(place, sys.executable, "-m", "build", "--outdir", place / "dist", ROOT)
        shutil.copytree(ROOT / "assets" / "demo", place / "assets" / "demo")
        (place / "readme.py").write_text(code, encoding="utf-8")
        for number, (version, python) in enumerate(at_hand.items()):
            for kind in ("*.whl", "*.tar.gz")[: 1 if number else 2]:
                (package,) = (place / "dist").glob(kind)
                _try(version, python, package, place)
    return 0 if at_hand else 1


def _try(version: str, python: str, package: Path, place: Path) -> None:
    """Install a package into an empty environment of a Python and use it."""
    start = time.monotonic()
    environment = place / f"environment-{version}{package.suffix}"
    _run(place, python, "-m", "venv", environment)
    binaries = environment / "bin"
    _run(place, binaries / "python", "-m", "pip", "install", "--quiet", package)
    _run(place, binaries / "mbw", "--version")
    _run(place, binaries / "python", "-I", "-c", "import mbworkbench")
    if package.suffix == ".whl":
        _run(place, binaries / "python", "-I", place / "readme.py")
        _begin_demo(environment, binaries / "mbw")
    print(f"Python {version}, {package.name}: {time.monotonic() - start:.0f} s", flush=True)


def _begin_demo(place: Path, command: Path) -> None:
    """Run ``mbw demo`` until its second step begins, and end it there."""
    words = [str(command), "demo", "--out", str(place / "demo")]
    with subprocess.Popen(
        words, cwd=place, env=_environment(), stderr=subprocess.PIPE, text=True
    ) as demo:
        assert demo.stderr is not None
        said = []
        for line in demo.stderr:
            said.append(line)
            if line.startswith(SECOND_STEP):
                demo.terminate()
                return
    raise SystemExit(f"mbw demo ended before its second step:\n{''.join(said)}")


def _find(version: str) -> str | None:
    """Return the newest Python of a version that starts; None if there is none.

    A name on the path may be a shim of pyenv for a version that is not chosen, which does not.
    """
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    of_pyenv = sorted(root.glob(f"versions/{version}.*/bin/python"))
    for python in (shutil.which(f"python{version}"), *map(str, reversed(of_pyenv))):
        if python is not None:
            start = subprocess.run([python, "-V"], capture_output=True, check=False)
            if start.returncode == 0:
                return python
    return None


def _run(place: Path, *words: str | Path) -> None:
    """Run a command outside the repository; it must succeed."""
    subprocess.run([*map(str, words)], cwd=place, env=_environment(), check=True)


def _environment() -> dict[str, str]:
    """Return the environment without what leads to this repository or its packages."""
    return {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}


if __name__ == "__main__":
    sys.exit(main())
