"""Cases on the habits of the command: output folders, silence, and what is said at the end."""

from tests.field.make_inputs.folder import array_files, identify, measured, write_case
from tests.field.virtual_machine import field_machine


def write():
    """Write all cases of this module."""
    values, coherence = measured(field_machine(stiffness=(1.7e6, 2.3e6, 6.2e4, 3.2e5)))
    files = array_files(values, coherence, model=True)
    twice = {f"{folder}/{name}": data for folder in ("one", "two") for name, data in files.items()}
    write_case(
        "habits/other_campaign_there",
        "results of another campaign in the output folder",
        "refused without --overwrite",
        [
            {"command": ["identify", "one", "--out", "out", "--no-pictures"]},
            {"command": ["identify", "one", "--out", "out", "--no-pictures"]},
            {
                "command": ["identify", "two", "--out", "out", "--no-pictures"],
                "exit_code": 3,
                "says": ["--overwrite"],
            },
            {"command": ["identify", "two", "--out", "out", "--no-pictures", "--overwrite"]},
        ],
        twice,
    )
    write_case(
        "habits/quiet",
        "--quiet on every verb that needs no long work",
        "nothing on stderr, JSON alone on stdout",
        [
            identify("--quiet", "--json", "-", stdout="json", quiet=True),
            {
                "command": ["predict", "model.xml", "--quiet", "--json", "-", "--out", "p"],
                "stdout": "json",
                "quiet": True,
            },
            {
                "command": ["tune", ".", "--quiet", "--json", "-", "--out", "t"],
                "stdout": "json",
                "quiet": True,
            },
            {
                "command": ["report", "t", "--quiet", "--out", "page.html"],
                "stdout": "empty",
                "quiet": True,
            },
        ],
        files,
    )
    write_case(
        "habits/after_tune",
        "a machine that lacks nothing",
        "tune does not say that something is missing",
        [{"command": ["tune", ".", "--out", "t"], "never": ["something is not modelled"]}],
        files,
    )
