"""Cases on what surrounds the command: renderer, memory, interrupts, and readers of its files."""

from tests.field.make_inputs.folder import write_case
from tests.field.virtual_machine import model_text

_PREDICT = ["predict", "model.xml", "--no-pictures", "--out", "p", "--overwrite"]
_VIEW = ["view", "model.xml", "--mode", "1", "--overwrite", "--out", "mode.png"]


def write():
    """Write all cases of this module."""
    write_case(
        "environment/renderer",
        "MUJOCO_GL names a renderer that does not exist",
        "a verb that draws nothing is as ever; a picture shows outlines, and a message says so",
        [
            {"command": _PREDICT, "environment": {"MUJOCO_GL": "nonsense"}},
            {
                "command": _VIEW,
                "environment": {"MUJOCO_GL": "nonsense"},
                "says": ["MuJoCo cannot render here (MUJOCO_GL is nonsense)"],
            },
        ],
        {"model.xml": model_text()},
    )
