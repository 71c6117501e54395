"""MuJoCo as the project loads it: without a renderer if need be, and without its log.

MuJoCo loads the library of its renderer when it is imported, and fails where ``MUJOCO_GL`` names
one that is missing or unknown. Only pictures need it, which then do without. This module has to be
imported before any other import of MuJoCo.

MuJoCo writes a warning to its console and to ``MUJOCO_LOG.TXT`` in the working directory. What it
warns of is checked here in other ways: the compiler's warnings are remarks of the machine, and a
singular mass matrix is refused with the name of the joint.
"""

import os
from importlib import import_module
from pathlib import Path
from typing import Any

from identification.words import InputError

_RENDERER = "MUJOCO_GL"  # variable of the environment that names MuJoCo's renderer


def _load_mujoco() -> Any:
    """Import MuJoCo, without any renderer if the wanted one cannot be loaded."""
    try:
        return import_module("mujoco")
    except Exception:  # whatever a missing library raises
        wanted = os.environ.get(_RENDERER)
        if wanted is None:
            raise
        os.environ[_RENDERER] = "disable"
        try:
            return import_module("mujoco")
        finally:
            os.environ[_RENDERER] = wanted


_MUJOCO = _load_mujoco()


def silence_mujoco_log() -> None:
    """Keep MuJoCo from writing its warnings to a file or to the console."""
    config = _MUJOCO.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()


def mujoco_path(path: Path) -> bytes:
    """Return a path as MuJoCo takes it, whatever encoding names of files have in the locale.

    Raises:
        InputError: the path is no UTF-8 text.
    """
    name = os.fsencode(path)
    try:
        name.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is no UTF-8 text, and MuJoCo reads no other paths: rename the folder or file"
        ) from error
    return name
