"""Cases on searches that do not end, drives in volts, hysteresis, and hits beside a sensor."""

import numpy as np

from tests.field.make_inputs.folder import CHANNELS, REFERENCES, identify, npz, write_case
from tests.field.virtual_machine import (
    DAMPING,
    FREQ_HZ,
    STIFFNESS,
    add_noise,
    field_machine,
    layout_text,
)

LEVELS_V = (0.1, 0.2, 0.3)
LINES = 150
SOFTENING = 0.03  # of the stiffness over the highest level (Rayleigh: in proportion to the level)
HINGES = """<mujoco model="hinges"><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
<body name="base"><inertial mass="20" pos="0 0 0" diaginertia="1 1 1"/>
<joint name="base_ry" type="hinge" axis="0 1 0" pos="0 0 -0.3" stiffness="9e4" damping="5"/>
<site name="acc1" pos="0.1 0 0.1"/>
<body name="arm" pos="0 0 0.3"><inertial mass="5" pos="0 0 0.1" diaginertia="0.1 0.1 0.1"/>
<joint name="arm_ry" type="hinge" axis="0 1 0" stiffness="{stiffness}" damping="{damping}"/>
<site name="acc2" pos="0.05 0 0.25"/></body></body></worldbody></mujoco>
"""
FLOORS = """<mujoco model="floors"><option gravity="0 0 0"/><worldbody>
<body name="floor1"><inertial mass="5.2" pos="0 0 0" diaginertia="0.03 0.05 0.08"/>
<joint name="leg1" type="slide" axis="1 0 0" stiffness="52000" damping="5"/>
<site name="acc1" pos="0.175 0 0"/><site name="hit1" pos="-0.175 0 0"/>
<body name="floor2" pos="0 0 0.18"><inertial mass="5.2" pos="0 0 0" diaginertia="0.03 0.05 0.08"/>
<joint name="leg2" type="slide" axis="1 0 0" stiffness="52000" damping="5"/>
<site name="acc2" pos="0.175 0 0"/></body></body></worldbody></mujoco>
"""


def write():
    """Write all cases of this module."""
    _hinge()
    _hysteresis_in_volts()
    _beside_a_sensor()


def _noisy(values, relative, seed):
    """Return FRFs with noise, a share of each one's rms, and the coherence of ten hits."""
    rng = np.random.default_rng(seed)
    deviation = relative * np.sqrt((np.abs(values) ** 2).mean(axis=0))
    noisy = values + deviation * (rng.normal(size=(*values.shape, 2)) @ [1, 1j]) / np.sqrt(2)
    return npz(
        frf=noisy.astype(np.complex64),
        coherence=(1 / (1 + 9 * (deviation / np.abs(noisy)) ** 2)).astype(np.float32),
        freq_hz=_line_frequencies(values),
    )


def _line_frequencies(values):
    return np.linspace(1, 60, len(values))


def _chain(masses, stiffness, damping, coordinates, lines):
    """Return accelerances at points that are combinations of coordinates; (n_freq, n, n)."""
    omega = 2 * np.pi * np.linspace(1, 60, lines)[:, None, None]
    dynamic = stiffness + 1j * omega * damping - omega**2 * masses
    columns = np.broadcast_to(coordinates.T, (lines, *coordinates.T.shape))
    return -(omega**2) * (coordinates @ np.linalg.solve(dynamic, columns))


def _hinge():
    # Rotations of base and arm against it, about y; small motions at the heights of the sites.
    coupling = 0.1 + 5 * 0.7 * 0.1
    mass = np.array([[1 + 20 * 0.3**2 + 0.1 + 5 * 0.7**2, coupling], [coupling, 0.1 + 5 * 0.1**2]])
    rows = np.array([[0.4, 0.0], [-0.1, 0.0], [0.85, 0.25], [-0.05, -0.05]])
    values = _chain(mass, np.diag([9e4, 3000.0]), np.diag([5.0, 1.0]), rows, LINES)[:, :, [0, 2]]
    write_case(
        "mutes/hinge",
        "a hinge whose drawn damping is 1000 times too small, out of reach of the fit",
        "the search ends, though the model never reaches the noise",
        [
            {
                "command": ["tune", ".", "--out", "out", "--no-pictures"],
                "says": ["converged after"],
                "never": ["out of evaluations"],
            }
        ],
        {
            "model.xml": HINGES.format(stiffness=300, damping=0.001),
            "t.npz": _noisy(values, 0.003, 1),
            "campaign.toml": 'model = "model.xml"\n[[test]]\nfile = "t.npz"\naverages = 10\n'
            'channels = ["acc1:+tx", "acc1:+tz", "acc2:+tx", "acc2:+tz"]\n'
            'references = ["acc1:+tx", "acc2:+tx"]\n'
            'quantity = "accelerance"\nunit = "m/s^2/N"\n',
        },
    )


def _hysteresis_in_volts():
    files = {"layout.toml": layout_text()}
    tests = 'layout = "layout.toml"\n[hammer.default]\ngain = "unknown"\n'
    for number, level in enumerate(LEVELS_V):
        amplitude = level / LEVELS_V[-1]
        softer = [value * (1 - SOFTENING * amplitude) for value in STIFFNESS]
        lossy = [value * (1 + 0.2 * amplitude) for value in DAMPING]
        values, coherence = add_noise(
            field_machine(softer, lossy).accelerance(), seed=number, relative=2e-3
        )
        files[f"t{number}.npz"] = npz(
            frf=(40 * values).astype(np.complex64),
            coherence=coherence.astype(np.float32),
            freq_hz=FREQ_HZ,
        )
        tests += (
            f'[[test]]\nfile = "t{number}.npz"\naverages = 10\nlevel = {level}\n{CHANNELS}\n'
            f'{REFERENCES}\nquantity = "accelerance"\nunit = "m/s^2/V"\n'
        )
    write_case(
        "mutes/hysteresis_in_volts",
        "a drive in volts at three levels; frequencies fall and damping rises with the level",
        "levels in volts, hysteresis named as a possibility, no word of newtons",
        [identify(says=["level check, 0.1 to 0.3 V:", "as hysteresis"], never=["0.3 N"])],
        {**files, "campaign.toml": tests},
    )


def _beside_a_sensor():
    mass = np.array([[10.4, 5.2], [5.2, 5.2]])  # the second slide moves on the first
    rows = np.array([[1.0, 0.0], [1.0, 1.0]])
    values = _chain(mass, np.diag([52e3, 52e3]), np.diag([5.0, 5.0]), rows, 300)[:, :, [0]]
    write_case(
        "mutes/hit_beside_a_sensor",
        "a floor that slides is hit at one end and read at the other",
        "both are named, with the entry that makes them a drive point",
        [
            identify(
                says=["apart on the one body floor1", "state hit1:+tx as acc1:+tx"],
                never=["as an output too"],
            )
        ],
        {
            "model.xml": FLOORS,
            "t.npz": _noisy(values, 0.003, 2),
            "campaign.toml": 'model = "model.xml"\n[[test]]\nfile = "t.npz"\naverages = 10\n'
            'channels = ["acc1:+tx", "acc2:+tx"]\nreferences = ["hit1:+tx"]\n'
            'quantity = "accelerance"\nunit = "m/s^2/N"\n',
        },
    )
