"""``make versions``: wheel and sdist in empty environments outside the repository.

Both are built, installed with all they depend on into a new environment of each Python that is at
hand, and tried there: ``mbw --version``, README's Python and ``mbw demo``. Pythons are those on the
path and those of pyenv; each that is missing is said.
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
WITH_DEMO = "3.12"  # one of them: its steps are those of README's Python
README_CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def main() -> int:
    """Try all Pythons that are at hand; return 0 if there is one and all do."""
    (code,) = README_CODE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        _run(place, sys.executable, "-m", "build", "--outdir", place / "dist", ROOT)
        shutil.copytree(ROOT / "assets" / "demo", place / "assets" / "demo")
        (place / "readme.py").write_text(code, encoding="utf-8")
        tried = [version for version in PYTHONS if _try(version, place)]
    return 0 if tried else 1


def _try(version: str, place: Path) -> bool:
    """Install into an empty environment of a Python and use it; return whether it is at hand."""
    python = _find(version)
    if python is None:
        print(f"Python {version} is not at hand")
        return False
    start = time.monotonic()
    (package,) = (place / "dist").glob("*.tar.gz" if version == PYTHONS[0] else "*.whl")
    environment = place / f"environment-{version}"
    _run(place, python, "-m", "venv", environment)
    binaries = environment / "bin"
    _run(place, binaries / "python", "-m", "pip", "install", "--quiet", package)
    _run(place, binaries / "mbw", "--version")
    _run(place, binaries / "python", "-I", place / "readme.py")
    if version == WITH_DEMO:
        _run(place, binaries / "mbw", "demo", "--out", place / "demo", "--quiet")
    print(f"Python {version}, {package.name}: {time.monotonic() - start:.0f} s", flush=True)
    return True


def _find(version: str) -> str | None:
    """Return the newest Python of a version; None if there is none."""
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    of_pyenv = sorted(root.glob(f"versions/{version}.*/bin/python"))
    return shutil.which(f"python{version}") or (str(of_pyenv[-1]) if of_pyenv else None)


def _run(place: Path, *words: str | Path) -> None:
    """Run a command outside the repository; it must succeed."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    subprocess.run([*map(str, words)], cwd=place, env=environment, check=True)


if __name__ == "__main__":
    sys.exit(main())
