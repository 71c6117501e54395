"""``mbw view``: a machine at rest or in a mode, in MuJoCo's viewer or in a picture."""

from pathlib import Path

import numpy as np

from identification.readers.result_files import ResultFile
from identification.words import InputError, UsageError
from mbmodel import Machine, as_drawn, load_machine, machine_geometry, shapes_at
from mbmodel.geometry.viewer import open_viewer, refuse_missing_display
from mbw.animation.draw import FRAMES, ModeScene, draw_mode, move_scene, outline_words
from mbw.animation.files import check_picture_target, write_pictures
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.prediction import Prediction, predict


class ViewedState(ResultFile):
    """What ``mbw view`` shows.

    Args:
        model: path of the MJCF.
        mode: number of the mode; null for the machine at rest.
        frequency: natural frequency [Hz]; null at rest.
        damping: damping ratio; null without a mode, and for a mode of zero frequency.
        picture: file of the picture; null for a window.
    """

    model: str
    mode: int | None
    frequency: float | None
    damping: float | None
    picture: str | None


def run(
    model: Path,
    *,
    mode: int | None,
    key: str | None,
    out: Path | None,
    json: Path | None,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.view.options`` describes them.

    Raises:
        UsageError: the model has no such mode, or the kind of picture is unknown.
        InputError: the model cannot be read, there is no display, or a file cannot be written.
    """
    _check_targets(out, overwrite=overwrite)
    machine = load_machine(model, key=key)
    prediction = predict(as_drawn(machine))
    if mode is not None and mode > len(prediction.modes.poles):
        raise UsageError(
            f"--mode {mode}: {model} has {len(prediction.modes.poles)} modes: mbw predict lists "
            "them"
        )
    scene = _scene(machine, prediction, mode)
    if json is not None:
        state = _state(model, prediction, mode, out)
        write_json(state.model_dump_json(indent=1), json)
    if out is None:
        _show(machine, prediction, scene, mode)
        return
    pictures, has_surfaces = draw_mode(scene, 1 if mode is None else FRAMES)
    write_pictures(out, pictures)
    how = outline_words(has_surfaces=has_surfaces)
    SCREEN.say(f"picture in {out}{how}")


def _check_targets(out: Path | None, *, overwrite: bool) -> None:
    """Refuse what cannot be written or shown, before the computation starts."""
    if out is None:
        refuse_missing_display()
        return
    check_picture_target(out)
    if out.exists() and not overwrite:
        raise InputError(f"{out} exists: name another file, or replace it with --overwrite")


def _scene(machine: Machine, prediction: Prediction, mode: int | None) -> ModeScene:
    """Return the machine at rest or in a mode of the nominal model."""
    model, bodies = prediction.model, machine.layout.bodies
    shape, caption = np.zeros((len(bodies), 6), complex), f"{machine.name} at rest"
    if mode is not None:
        shapes = shapes_at(model, model.drawn, prediction.modes, machine.layout.body_dofs())
        shape = shapes[:, mode - 1].reshape(-1, 6)
        caption = f"Mode {mode}: {_mode_words(prediction, mode)}"
    return ModeScene(caption, machine.layout, machine_geometry(machine), machine, shape)


def _mode_words(prediction: Prediction, mode: int) -> str:
    """Return frequency and damping of a mode in words."""
    modes, words = prediction.modes, prediction.damping_words[mode - 1]
    if not modes.poles[mode - 1].imag > 0:
        return f"{modes.names[mode - 1]} {words}".strip()
    return f"{modes.freq_hz[mode - 1]:.4g} Hz, damping {100 * modes.damping[mode - 1]:.3g} %"


def _state(model: Path, prediction: Prediction, mode: int | None, out: Path | None) -> ViewedState:
    return ViewedState(
        model=str(model),
        mode=mode,
        frequency=None if mode is None else float(prediction.modes.freq_hz[mode - 1]),
        damping=_damping(prediction, mode),
        picture=None if out is None else str(out),
    )


def _damping(prediction: Prediction, mode: int | None) -> float | None:
    """Return the damping ratio of a mode; None at rest and for a mode of zero frequency."""
    if mode is None or prediction.is_at_rest(mode - 1):
        return None
    return float(prediction.modes.damping[mode - 1])


def _show(machine: Machine, prediction: Prediction, scene: ModeScene, mode: int | None) -> None:
    """Open the viewer until the user closes it."""
    shape = np.zeros(len(prediction.modes.shapes), complex)
    if mode is not None:
        shape = move_scene(scene, 1).factor * prediction.modes.shapes[:, mode - 1]
    SCREEN.say(f"{scene.caption}; close the window of the viewer to end")
    open_viewer(machine, shape)
