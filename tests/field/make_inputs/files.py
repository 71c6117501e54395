"""Cases on campaign.toml, layouts and tables that are broken, and on files that cannot be used."""

from tests.field.make_inputs.folder import (
    ARRAYS,
    array_files,
    campaign,
    identify,
    measured,
    npz,
    write_case,
)
from tests.field.virtual_machine import FREQ_HZ, layout_text, model_text


def write():
    """Write all cases of this module."""
    _campaigns()
    _layouts()
    _arrays()
    _results()


def _campaigns():
    broken = {
        "deep": ("10,000 brackets", "a = " + "[" * 10_000),
        "huge_integer": (
            "an integer of 10,000 digits",
            campaign(ARRAYS).replace("averages = 10", f"averages = {'9' * 10_000}"),
        ),
        "nul_in_name": (
            "a file name with a NUL character",
            campaign(ARRAYS).replace('"t.npz"', '"t\\u0000.npz"'),
        ),
        "folder_as_file": (
            "a folder as the file of a test",
            campaign(ARRAYS).replace('"t.npz"', '"."'),
        ),
        "device": (
            "a device that never ends as the file of a test",
            campaign(ARRAYS).replace('"t.npz"', '"/dev/zero"'),
        ),
        "binary": ("binary instead of text", b"\x00\x80\xff" * 4_000),
        "text_for_number": (
            "text where a number is due",
            campaign(ARRAYS).replace("averages = 10", 'averages = "ten"'),
        ),
        "unknown_key": ("a key that nobody knows", campaign(ARRAYS, top="modle = 3")),
    }
    for name, (situation, text) in broken.items():
        write_case(
            f"files/toml_{name}",
            situation,
            "exit 3 and one short sentence",
            [identify(exit_code=3, says=["campaign.toml" if name != "device" else "zero"])]
            if name not in ("folder_as_file", "nul_in_name")
            else [identify(exit_code=3)],
            {"campaign.toml": text, "layout.toml": layout_text(), "t.npz": b""},
            limit_s=20,
        )
    values, coherence = measured()
    write_case(
        "files/missing_measurement",
        "a file that does not exist",
        "exit 3, naming it",
        [identify(exit_code=3, says=["there.npz"])],
        {
            "campaign.toml": campaign(ARRAYS.replace("t.npz", "there.npz")),
            "layout.toml": layout_text(),
        },
    )
    write_case(
        "files/not_a_campaign",
        "a measurement where a campaign is due",
        "exit 3, saying what a campaign is",
        [
            {
                "command": ["identify", "t.npz", "--out", "out"],
                "exit_code": 3,
                "says": ["campaign.toml"],
            }
        ],
        {"t.npz": npz(frf=values, coherence=coherence, freq_hz=FREQ_HZ)},
    )


def _layouts():
    values, coherence = measured()
    broken = {
        "true": layout_text().replace("0.2, ", "true, ", 1),
        "text": layout_text().replace("0.2, ", '"0.2", ', 1),
        "infinite": layout_text().replace("0.2, ", "inf, ", 1),
        "two_axes": layout_text().replace("0.2, ", "", 1),
    }
    for name, text in broken.items():
        files = array_files(values, coherence)
        files["layout.toml"] = text
        write_case(
            f"files/layout_{name}",
            f"a layout with {name.replace('_', ' ')} in a position",
            "exit 3, naming the site",
            [identify(exit_code=3, says=["acc1"])],
            files,
        )


def _arrays():
    values, coherence = measured()
    huge = values.astype(complex)
    huge[30, 0, 0] = 1e300
    write_case(
        "files/huge_frf",
        "an FRF value of 1e300",
        "exit 3 and one sentence",
        [identify(exit_code=3, says=["t.npz"])],
        array_files(huge, coherence),
    )
    bad = values.copy()
    bad[30, 0, 0] = float("nan")
    write_case(
        "files/nan_frf",
        "an FRF value that is not a number",
        "exit 3, naming frequency, response and reference",
        [identify(exit_code=3, says=["t.npz", "15.5 Hz"])],
        array_files(bad, coherence),
    )


def _results():
    write_case(
        "files/altered_result",
        "a result of tune whose JSON was altered",
        "exit 3 and one sentence",
        [{"command": ["report", "done", "--out", "out"], "exit_code": 3}],
        {"done/tuned.json": '{"campaign": "x", "parameters": [1, 2, "three"]}'},
    )
    write_case(
        "files/model_as_result",
        "a model where a result is due",
        "exit 3 and one sentence",
        [{"command": ["report", "model.xml", "--out", "out"], "exit_code": 3}],
        {"model.xml": model_text()},
    )
    write_case(
        "files/campaign_as_model",
        "a campaign without a model where a model is due",
        "exit 3, saying that it names no model",
        [{"command": ["predict", "."], "exit_code": 3, "says": ["names no model"]}],
        {"campaign.toml": campaign(ARRAYS)},
    )
