"""MuJoCo's interactive viewer, with a machine at rest or moving in a mode."""

import os
import sys
import time
import warnings
from importlib import import_module

import mujoco
import numpy as np

from identification.words import Complex, InputError
from mbmodel.geometry.surfaces import pose_machine
from mbmodel.machine import Machine

_CYCLE_S = 1.8  # duration of a cycle, whatever the frequency of the mode
_FRAME_S = 1 / 60  # between two pictures

_REMEDY = "write a picture instead with --out view.gif"


def refuse_missing_display() -> None:
    """Refuse to open a window where there is no display.

    MuJoCo's viewer would end the process there.

    Raises:
        InputError: GLFW, the library of the viewer's window, finds no display.
    """
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    is_named = not sys.platform.startswith("linux") or any(os.environ.get(name) for name in names)
    if not (is_named and _has_windows()):
        raise InputError(f"there is no display for the window of MuJoCo's viewer: {_REMEDY}")


def _has_windows() -> bool:
    """Return whether GLFW can open windows."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return bool(import_module("glfw").init())
        except Exception:  # whatever a missing library raises
            return False


def open_viewer(machine: Machine, shape: Complex) -> None:
    """Show a machine in MuJoCo's viewer until its window is closed.

    The joint coordinates move from static equilibrium by Re(shape exp(i 2 pi t / T)), without
    decay; nothing is simulated.

    Args:
        machine: read from an MJCF that still exists.
        shape: mode shape, enlarged to be seen, in joint coordinates; zero for a machine at rest;
            (nv,).

    Raises:
        InputError: the window cannot be opened.
    """
    model, data, _ = pose_machine(machine)
    rest = np.array(data.qpos)
    mujoco.mj_fwdPosition(model, data)
    try:
        handle = import_module("mujoco.viewer").launch_passive(model, data)
    except Exception as error:  # whatever a driver or a missing library raises
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"MuJoCo's viewer cannot open a window ({reason}): {_REMEDY}") from error
    start = time.monotonic()
    with handle:
        while handle.is_running():
            turn = np.exp(2j * np.pi * (time.monotonic() - start) / _CYCLE_S)
            with handle.lock():
                data.qpos[:] = rest
                mujoco.mj_integratePos(model, data.qpos, (shape * turn).real, 1.0)
                mujoco.mj_fwdPosition(model, data)
            handle.sync()
            time.sleep(_FRAME_S)
