"""Two versions of the project beside each other, run with the same installed dependencies."""

import hashlib
import os
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("identification", "mbmodel", "tuning", "diagnosis", "truth", "mbw", "mbworkbench")


@dataclass(frozen=True)
class Version:
    """A source tree of the project whose commands can be run.

    Attributes:
        root: top folder of the source tree.
        results: folder for what its commands write.
    """

    root: Path
    results: Path

    def state(self) -> str:
        """Return a hash of every source file: other ones may compute something else."""
        digest = hashlib.sha256()
        for package in PACKAGES:
            for path in sorted((self.root / package).rglob("*.py")):
                digest.update(str(path.relative_to(self.root)).encode() + path.read_bytes())
        return digest.hexdigest()[:16]

    def python(self, *arguments: str | Path, log: Path, effects: Path | None = None) -> int:
        """Run this version's Python with these arguments and return its exit code.

        The tree precedes the installed packages on the path, so that both versions import the
        same dependencies and each its own packages.

        Args:
            arguments: of ``python``.
            log: file to which what it prints is added.
            effects: folder with an installed package of effects, if one is used.
        """
        path = [str(self.root), *([str(effects)] if effects else [])]
        settings = {"PYTHONPATH": os.pathsep.join(path), "OMP_NUM_THREADS": "1"}
        call = [sys.executable, *map(str, arguments)]
        with log.open("a", encoding="utf-8") as file:
            file.write(f"{' '.join(call)}\n")
            file.flush()
            environment = {**os.environ, **settings}
            return subprocess.run(
                call, cwd=self.root, env=environment, stdout=file, stderr=file, check=False
            ).returncode


def check_out(commit: str, work: Path) -> Version:
    """Check a commit out in a worktree of its own, once.

    Args:
        commit: name of the commit.
        work: folder for worktrees and results.

    Raises:
        subprocess.CalledProcessError: there is no such commit.
    """
    name = _git("rev-parse", "--short", f"{commit}^{{commit}}")
    folder = work / name
    tree = folder / "tree"
    if not (tree / "pyproject.toml").is_file():
        _git("worktree", "prune")
        _git("worktree", "add", "--detach", str(tree), name)
    return Version(tree, _made(folder / f"results-{_dependencies()}"))


def working_tree(work: Path) -> Version:
    """Return the tree that this file belongs to, with whatever is not committed."""
    return Version(ROOT, _made(work / "now" / f"results-{_dependencies()}"))


def install_effects(source: Path, folder: Path) -> Path:
    """Install the example of a user's effect into a folder, as pip would, without pip.

    Args:
        source: ``assets/<effect>_effect`` of some version.
        folder: where it goes.
    """
    module, effect = source.name, source.name.removesuffix("_effect")
    info = _made(folder / f"{module}-1.0.dist-info")
    metadata = f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    entry = f"[mbw.effects]\n{effect} = {module}:EFFECT\n"
    (info / "entry_points.txt").write_text(entry, encoding="utf-8")
    code = (source / f"{module}.py").read_text(encoding="utf-8")
    (folder / f"{module}.py").write_text(code, encoding="utf-8")
    return folder


def _dependencies() -> str:
    """Return a hash of the versions of all installed packages: other versions, other results."""
    installed = sorted(f"{item.name}=={item.version}" for item in distributions())
    return hashlib.sha256("\n".join(installed).encode()).hexdigest()[:8]


def _git(*arguments: str) -> str:
    done = subprocess.run(
        ["git", *arguments], cwd=ROOT, check=True, text=True, stdout=subprocess.PIPE
    )
    return done.stdout.strip()


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder
