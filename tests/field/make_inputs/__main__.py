"""Writes the inputs of all field cases again: ``python -m tests.field.make_inputs``."""

import sys
from importlib import import_module
from pathlib import Path

GROUPS = (
    "units",
    "modes",
    "readers",
    "files",
    "models",
    "references",
    "habits",
    "exports",
    "disagreement",
    "written",
    "advice",
    "environment",
    "mutes",
)


def main():
    """Write the cases of every group."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "helpers"))
    for group in GROUPS:
        import_module(f"tests.field.make_inputs.{group}").write()


if __name__ == "__main__":
    main()
