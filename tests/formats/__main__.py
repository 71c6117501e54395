"""``python -m tests.formats``: keep small results of every verb as this version writes them.

They lie in ``tests/formats/<version>/`` and are read by the versions that follow. Each release adds
its own; a folder that is there is never made anew. Pages are left out.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent
ASSETS = HERE.parents[1] / "assets"
GONDOLA = ASSETS / "gondola"
CALLS = {
    "campaign": (
        f"simulate {ASSETS}/two_bodies.xml --hammer acc1 --hits 2 --rate 512 --block 0.25 --seed 5"
    ),
    "identified": "identify {here}/campaign",
    "tuned": "tune {here}/campaign",
    "diagnosed": "diagnose {here}/campaign",
    "plant": (
        "predict {here}/tuned --bands --lines 51 --input acc1:+tx --output acc5:+tx "
        "--statespace {here}/plant/plant.npz --json {here}/plant/plant.json"
    ),
    "matched": f"match {GONDOLA}/shapes.vtu {GONDOLA}/campaign --band 18 24",
    "placed": f"place {GONDOLA}/shapes.vtu --channels 21 --band 15 60 --json {{here}}/placed.json",
    "blind": f"blind {ASSETS}/two_bodies.xml --cases 1 --seed 3 --effect mass_error",
}
_PLACE = re.compile(r'(?<=")[^"\s]*/(?=assets/)')  # of the project on the machine that made them
_LEFT_OUT = ("*.html", "*.mat", "*.uff", "*.unv", "body_frfs.npz")  # pages, what nothing reads


def main() -> int:
    """Make the folder of this version; return 0."""
    target = HERE / ".".join(version("mbworkbench").split(".")[:2])
    if target.exists():
        print(f"{target} is kept as it is", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as name:
        here = Path(name) / target.name
        here.mkdir()
        for call, words in CALLS.items():
            (here / call).mkdir()
            rest = words.format(here=here).split()
            command = [sys.executable, "-m", "mbw", *rest, "--out", str(here / call), "--quiet"]
            code = subprocess.run(command, check=False).returncode
            if code not in (0, 4):
                print(f"{' '.join(command)} ended with exit code {code}", file=sys.stderr)
                return code
        for path in (path for pattern in _LEFT_OUT for path in here.rglob(pattern)):
            path.unlink()
        for path in here.rglob("*.json"):
            text = _PLACE.sub("", path.read_text(encoding="utf-8"))
            path.write_text(text.replace(f"{here}/", ""), encoding="utf-8")
        shutil.copytree(here, target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
