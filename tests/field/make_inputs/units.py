"""Cases on units, signs and quantities."""

import numpy as np
from identification_examples import Function, dataset

from tests.field.make_inputs.folder import (
    ARRAYS,
    CHANNELS,
    REFERENCES,
    UNIVERSAL,
    array_files,
    campaign,
    identify,
    measured,
    modes_are,
    write_case,
)
from tests.field.virtual_machine import FREQ_HZ, field_machine, layout_text

GRAVITY = 9.80665
OMEGA = 2 * np.pi * FREQ_HZ[:, None, None]


def write():
    """Write all cases of this module."""
    _labels_and_stated_units()
    _model_against_data()
    _signs()
    _places()
    _coherence_and_doubles()


def universal(values, coherence=None, **function):
    """Return a universal file of single-precision binary FRFs, direction 3, two references."""
    content = b""
    for column, reference in enumerate((1, 3)):
        for row in range(values.shape[1]):
            common = {"x": FREQ_HZ, "rsp": (row + 1, 3), "ref": (reference, 3), "order": "<"}
            content += Function(
                values[:, row, column], single=True, **{**common, **function}
            ).content()
            if coherence is not None:
                content += Function(
                    coherence[:, row, column],
                    func=6,
                    ordinate=0,
                    single=True,
                    **{**common, "order": function.get("order", "<")},
                ).content()
    return content


def _universal_files(content, test=UNIVERSAL):
    return {"campaign.toml": campaign(test), "layout.toml": layout_text(), "t.uff": content}


def _labels_and_stated_units():
    freq, damping = field_machine().modes()
    values, coherence = measured()
    scale = [
        *modes_are(freq, damping),
        {"path": "quantity", "equals": "accelerance"},
    ]
    write_case(
        "units/label_g",
        "a universal file whose ordinate is labelled g, without dataset 164",
        "the modes, and a remark that the label counts",
        [identify("--json", "r.json", says=["labelled g"], value=scale)],
        _universal_files(universal(values / GRAVITY, coherence, motion_unit="g", force_unit="N")),
    )
    write_case(
        "units/stated_g",
        "an array in g per newton, stated by unit",
        "the modes",
        [identify("--json", "r.json", value=scale)],
        array_files(values / np.float32(GRAVITY), coherence, f'{ARRAYS}\nunit = "g/N"'),
    )
    write_case(
        "units/override",
        "a label g that is wrong: unit is stated for a universal file",
        "the stated unit counts, with a remark",
        [identify("--json", "r.json", says=["overrides"], value=scale)],
        _universal_files(
            universal(values, coherence, motion_unit="g", force_unit="N"),
            f'{UNIVERSAL}\nunit = "m/s^2/N"',
        ),
    )
    write_case(
        "units/unknown_unit",
        "a unit that nobody knows",
        "exit 3 and the units that can be stated",
        [identify(exit_code=3, says=["furlong", "m/s^2/N"])],
        array_files(values, coherence, f'{ARRAYS}\nunit = "furlong/N"'),
    )


def _refused_by_both_verbs(says):
    return [
        {"command": [verb, ".", "--out", "out"], "exit_code": 3, "says": says}
        for verb in ("tune", "diagnose")
    ]


def _model_against_data():
    values, coherence = measured()
    wrong = {
        "g": (values / GRAVITY, "FRFs in g per newton, called m/s^2/N", ["g/N"]),
        "mm": (values * 1e3, "FRFs in mm/s^2/N, called m/s^2/N", ["mm/s^2/N"]),
        "receptance": (values / -(OMEGA**2), "receptance given as accelerance", ["receptance"]),
        "mobility": (values / (1j * OMEGA), "mobility given as accelerance", ["mobility"]),
    }
    wrong["kilonewton"] = (values * 1e3, "FRFs per kN given as SI", ["kN"])
    for name, (given, situation, says) in wrong.items():
        write_case(
            f"units/{name}_not_stated",
            situation,
            "exit 3 before any fit, naming the likely reason",
            _refused_by_both_verbs(says),
            array_files(given.astype(np.complex64), coherence, model=True),
            limit_s=30,
        )
    # Below its modes a machine with all springs 4.4 times softer looks alike: its masses must show.
    wide = np.arange(1.0, 301.0)
    per_pound, of_pound = measured(freq_hz=wide)
    write_case(
        "units/pound_not_stated",
        "FRFs per lbf given as SI",
        "exit 3 before any fit, naming the likely reason",
        _refused_by_both_verbs(["lbf"]),
        array_files(per_pound * np.float32(4.4482216), of_pound, model=True, freq_hz=wide),
        limit_s=30,
    )
    write_case(
        "units/radians_per_second",
        "a frequency axis in rad/s, called Hz",
        "exit 3 before any fit, naming rad/s",
        _refused_by_both_verbs(["rad/s"]),
        array_files(values, coherence, model=True, freq_hz=2 * np.pi * FREQ_HZ),
        limit_s=30,
    )
    write_case(
        "units/right",
        "the same machine with right units, springs off by up to 2 times",
        "tuned",
        [{"command": ["tune", ".", "--out", "out"], "never": ["g/N", "lbf", "rad/s"]}],
        array_files(
            measured(field_machine(stiffness=(2.9e6, 1.4e6, 9.0e4, 2.2e5)))[0],
            coherence,
            model=True,
        ),
    )


def _signs():
    freq, damping = field_machine().modes()
    values, coherence = measured()
    write_case(
        "units/conjugated",
        "FRFs in the convention exp(-i omega t)",
        "the key time_sign is named; with it the modes",
        [
            identify(exit_code=3, says=["time_sign"]),
            {
                "command": ["identify", "stated", "--out", "o2", "--no-pictures", "--json", "r"],
                "value": modes_are(freq, damping),
            },
        ],
        {
            **_universal_files(universal(values.conj(), coherence)),
            "stated/campaign.toml": campaign(f'{UNIVERSAL}\ntime_sign = "-"'),
            "stated/layout.toml": layout_text(),
            "stated/t.uff": universal(values.conj(), coherence),
        },
    )
    write_case(
        "units/drive_lags",
        "a drive whose force leads the motion by 10 ms",
        "a delay is named, not an opposite sign",
        [identify(says=["ms"], never=["reads with the opposite sign"])],
        array_files((values * np.exp(-1j * OMEGA * 0.01)).astype(np.complex64), coherence),
    )


def _places():
    values, coherence = measured()
    write_case(
        "units/sites_in_mm",
        "sites in mm on a machine in m",
        "exit 3, naming mm",
        _refused_by_both_verbs(["mm"]),
        array_files(values, coherence, model=True, scale=1000.0),
    )
    nodes = dataset(
        "    15",
        [
            f"{n:10d}{0:10d}{0:10d}{1:10d}{200 * n:13.5E}{50 * n % 170:13.5E}{300:13.5E}"
            for n in range(1, 6)
        ],
    )
    write_case(
        "units/geometry_in_mm",
        "a geometry in mm without dataset 164",
        "a remark on the size of the machine, naming mm",
        [identify(says=["mm"])],
        {
            "campaign.toml": f'layout = "g.unv"\n[[test]]\n{UNIVERSAL}\n',
            "g.unv": nodes,
            "t.uff": universal(values, coherence),
        },
    )


def _coherence_and_doubles():
    values, coherence = measured()
    write_case(
        "units/coherence_in_per_cent",
        "coherence from 0 to 100",
        "exit 3, naming per cent",
        [identify(exit_code=3, says=["per cent"])],
        array_files(values, 100 * coherence),
    )
    exact, slightly = measured(noise=1e-3)
    slightly = np.where(slightly > 1 - 1e-5, 1 + 5e-5, slightly)
    write_case(
        "units/coherence_slightly_above_one",
        "coherence up to 1 + 5e-5, as single precision gives it",
        "the modes",
        [identify("--json", "r.json", value=modes_are(field_machine().modes()[0]))],
        array_files(exact, slightly),
    )
    few = coherence.copy()
    few[40:43] = 1.25
    write_case(
        "units/coherence_above_one_on_few_lines",
        "coherence of 1.25 on three lines",
        "the modes, and a remark",
        [
            identify(
                "--json", "r.json", says=["coherence"], value=modes_are(field_machine().modes()[0])
            )
        ],
        array_files(values, few),
    )
    write_case(
        "units/coherence_negative",
        "negative coherence",
        "exit 3",
        [identify(exit_code=3, says=["coherence"])],
        array_files(values, -coherence),
    )
    files = array_files(values, coherence)
    twice = f'{ARRAYS}\n[[test]]\nfile = "again.npz"\naverages = 10\n{CHANNELS}\n{REFERENCES}\n'
    files["campaign.toml"] = campaign(twice + 'quantity = "accelerance"')
    files["again.npz"] = files["t.npz"]
    write_case(
        "units/one_test_twice",
        "one test a second time under another name",
        "both files are named",
        [identify(exit_code=3, says=["t.npz", "again.npz"])],
        files,
    )
