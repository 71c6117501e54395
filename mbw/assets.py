"""Paths of the built-in data: inside an installed package, beside it in a clone."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_FOLDERS = (_PACKAGE / "assets", _PACKAGE.parent / "assets")


def asset_path(name: str) -> Path:
    """Return the path of a built-in file or folder, such as ``demo``.

    Raises:
        FileNotFoundError: the installation lacks the file.
    """
    for folder in _FOLDERS:
        if (folder / name).exists():
            return folder / name
    raise FileNotFoundError(f"the built-in {name} is missing: install mbworkbench again")
