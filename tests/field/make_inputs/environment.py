"""Cases on what surrounds the command: renderer, memory, interrupts, and readers of its files."""

from tests.field.make_inputs.folder import (
    ARRAYS,
    array_files,
    identify,
    measured,
    modes_are,
    write_case,
)
from tests.field.virtual_machine import field_machine, model_text

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
    _write_formula_name()
    _write_loop_without_gain()


def _write_formula_name():
    values, coherence = measured()
    name = "=HYPERLINK(1)"
    test = ARRAYS.replace('"nodes 1..5, z"', f'["{name}:+tz", "nodes 2..5, z"]')
    test = test.replace('"1:+z"', f'"{name}:+tz"')
    files = array_files(values, coherence, test, model=True)
    files["model.xml"] = files["model.xml"].replace("acc1", name)
    write_case(
        "environment/formula_name",
        "the name of a sensor begins with =",
        "identified as any other; text, not a formula, in CSV",
        [
            identify("--json", "result.json", value=modes_are(field_machine().modes()[0])),
        ],
        files,
    )


_LOOP = """
band = [1.0, 100.0]
[error.stage]
output = "acc1:+tz"
[disturbance.force]
input = "acc2:+tz"
density = 0.01
unit = "N/sqrt(Hz)"
[loop.z]
input = "acc3:+tz"
output = "acc1:+tz"
controller = { gain = 0.0 }
delay = 2e-4
"""


def _write_loop_without_gain():
    command = ["predict", "model.xml", "--budget", "budget.toml", "--no-pictures"]
    path = "budget.margins.loops.*"
    write_case(
        "environment/loop_without_gain",
        "a budget whose controller has a gain of zero",
        "the budget of the open machine; no margins, and a sentence that says so",
        [
            {
                "command": [*command, "--out", "p", "--json", "result.json"],
                "value": [
                    {"path": f"{path}.sensitivity_peak", "near": [1.0]},
                    {
                        "path": "budget.remarks",
                        "equals": ["Loop z has no gain, so that it has no margins."],
                    },
                ],
            }
        ],
        {"model.xml": model_text(), "budget.toml": _LOOP},
    )
