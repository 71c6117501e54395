"""Cases on references and channels that are no translation, or have no known gain."""

import numpy as np

from tests.field.make_inputs.folder import (
    ARRAYS,
    array_files,
    campaign,
    identify,
    measured,
    modes_are,
    npz,
    write_case,
)
from tests.field.virtual_machine import FREQ_HZ, add_noise, field_machine, model_text

OMEGA = 2 * np.pi * FREQ_HZ[:, None]


def write():
    """Write all cases of this module."""
    _torque()
    _gains()


def _torque():
    """Add a test with a torque about x at sensor 1, and one channel that reads a rotation."""
    machine = field_machine()
    dynamic = machine.K + 1j * OMEGA[:, :, None] * machine.C - OMEGA[:, :, None] ** 2 * machine.M
    about_x = np.array([0.0, 0.0, 1.0, 0.0])
    outputs = np.vstack([machine.S, about_x])
    forces = np.column_stack([machine.S[0], about_x])
    answer = np.linalg.solve(dynamic, np.broadcast_to(forces, (len(FREQ_HZ), 4, 2)))
    values, coherence = add_noise(-(OMEGA[:, :, None] ** 2) * (outputs @ answer))
    test = (
        'file = "t.npz"\naverages = 10\n'
        'channels = ["1:+z", "2:+z", "3:+z", "4:+z", "5:+z", "2:+rx"]\n'
        'references = ["1:+z", "1:+rx"]\nquantity = "accelerance"'
    )
    write_case(
        "references/torque",
        "a torque as reference and a rotation as channel",
        "identified, tuned and diagnosed: nothing is missing",
        [
            identify("--json", "r.json", value=modes_are(machine.modes()[0])),
            {"command": ["tune", ".", "--out", "tuned", "--json", "t.json"]},
            {
                "command": ["diagnose", ".", "--out", "diagnosed", "--json", "d.json"],
                "value": [{"path": "verdict", "equals": "none"}],
            },
        ],
        {
            "campaign.toml": campaign(test, model=True),
            "model.xml": model_text(),
            "t.npz": npz(
                frf=values.astype(np.complex64),
                coherence=coherence.astype(np.float32),
                freq_hz=FREQ_HZ,
            ),
        },
        limit_s=150,
    )


def _gains():
    values, coherence = measured(field_machine(stiffness=(1.7e6, 2.3e6, 6.2e4, 3.2e5)))
    counts = values.copy()
    counts[:, 3] *= 2048.0
    write_case(
        "references/channel_in_counts",
        "a channel in counts, whose gain is stated as unknown",
        "tuned; the gain is found",
        [{"command": ["tune", ".", "--out", "out", "--json", "r.json"]}],
        array_files(counts, coherence, model=True, top='[sensor.acc4]\ngain = "unknown"'),
        limit_s=120,
    )
    write_case(
        "references/drive_in_volts",
        "a drive in volts, whose gain is stated as unknown",
        "tuned; the gain is found",
        [{"command": ["tune", ".", "--out", "out", "--json", "r.json"]}],
        array_files(
            values / np.float32(37.0),
            coherence,
            f'{ARRAYS}\nhammer = "coil"',
            model=True,
            top='[hammer.coil]\ngain = "unknown"',
        ),
        limit_s=120,
    )
