"""Cases on modes, their scale, bands, windows and lines that are left out."""

import numpy as np
from hammer_records import Hammer, System, strike

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
from tests.field.virtual_machine import FREQ_HZ, add_noise, field_machine, layout_text

_LABELS = tuple(f"{node}:+z" for node in range(1, 6))
_RECORDS = f'file = "hits.npz"\nchannels = {list(_LABELS)}\nreferences = ["1:+z"]'.replace("'", '"')
_DAMPING = (0.010, 0.015, 0.008, 0.020)
_MODES_HZ = (20.0, 35.0, 52.0, 80.0)


def write():
    """Write all cases of this module."""
    _close_modes()
    _bands()
    _records()
    _left_out_lines()


def _system(freq_hz=_MODES_HZ, damping=_DAMPING):
    """Return a structure of five sensors with real mode shapes, driven at the first."""
    rng = np.random.default_rng(5)
    n = len(freq_hz)
    shapes = rng.uniform(0.3, 1.0, (5, n)) * rng.choice([-1, 1], (5, n)) / np.sqrt(50.0)
    return System(np.asarray(freq_hz), np.asarray(damping), shapes, shapes[0])


def _frfs(freq_hz, damping, references=(0, 2)):
    """Return the accelerance of that structure; (n_freq, 5, n_ref)."""
    system = _system(freq_hz, damping)
    columns = [
        System(system.freq_hz, system.damping, system.shapes, system.shapes[r]).accelerance(
            2j * np.pi * FREQ_HZ
        )
        for r in references
    ]
    return np.stack(columns, axis=2)


def _close_modes():
    for name, step in (("repeated", 0.0), ("close", 1.4e-4)):
        freq = (20.0, 35.0, 35.0 * (1 + step), 80.0)
        damping = (0.010, 0.015, 0.015, 0.020)
        values, coherence = add_noise(_frfs(freq, damping))
        write_case(
            f"modes/{name}_roots",
            f"two modes {100 * step:g} % apart, two references",
            "four modes whose shapes give the measured FRFs",
            [identify("--json", "r.json", value=modes_are(freq, tolerance=1e-3))],
            array_files(values.astype(np.complex64), coherence.astype(np.float32)),
        )
    system = _system()
    system.shapes[2, 1] = 1e-5 * system.shapes[0, 1]
    values = np.stack(
        [
            System(
                system.freq_hz, system.damping, system.shapes, system.shapes[reference]
            ).accelerance(2j * np.pi * FREQ_HZ)
            for reference in (2,)
        ],
        axis=2,
    )
    values, coherence = add_noise(values)
    test = ARRAYS.replace('["1:+z", "3:+z"]', '["3:+z"]')
    write_case(
        "modes/reference_at_a_node",
        "the only reference lies at a node of the second mode",
        "the other modes, and no scale of the second in silence",
        [identify("--json", "r.json", value=[{"path": "modes.0.frequency", "near": 20.0}])],
        array_files(values.astype(np.complex64), coherence.astype(np.float32), test),
    )


def _bands():
    freq, damping = field_machine().modes()
    values, coherence = measured()
    bad = coherence.copy()
    bad[[0, 1, 60, 61, 120, 180]] = 0.05
    write_case(
        "modes/few_bad_lines",
        "coherence of 0.05 on a few lines within the band",
        "the modes of the whole band",
        [identify("--json", "r.json", value=modes_are(freq, damping))],
        array_files(values, bad),
    )
    bad = coherence.copy()
    bad[2:40] = 0.08
    bad[0] = 0.9
    write_case(
        "modes/bad_start",
        "coherence of 0.9 on the first line and 0.08 up to 20 Hz",
        "a band that begins at 20 Hz, and its modes",
        [
            identify(
                "--json",
                "r.json",
                value=[
                    *modes_are(freq, damping),
                    {"path": "band.0", "near": 20.0, "tolerance": 0.15},
                ],
            )
        ],
        array_files(values, bad),
    )
    silent = 1e-3 * np.random.default_rng(3).normal(size=(len(FREQ_HZ), 5, 2, 2)) @ (1.0, 1j)
    write_case(
        "modes/none",
        "FRFs of noise alone",
        "it is said that no mode was found, and what to do",
        [identify(says=["no mode"])],
        array_files(silent.astype(np.complex64), None),
    )


def _records():
    hammer = Hammer(outputs=_LABELS, reference="1:+z", noise=2e-4, duration_s=2.0)
    records = strike(_system(), hammer)
    time = np.arange(records.force.shape[-1]) / records.rate_hz
    tau = 0.25
    start = 0.1
    window = np.where(time < start, 1.0, np.exp(-(time - start) / tau))
    write_case(
        "modes/windowed_records",
        "records that the analyser has windowed already",
        "window_tau states it; then the right damping",
        [identify("--json", "r.json", value=modes_are(_MODES_HZ, _DAMPING, tolerance=2.5e-3))],
        {
            "campaign.toml": campaign(f"{_RECORDS}\nwindow_tau = {tau}"),
            "layout.toml": layout_text(),
            "hits.npz": npz(
                force=(records.force * window).astype(np.float32),
                response=(records.motion * window).astype(np.float32),
                rate_hz=records.rate_hz,
            ),
        },
    )


def _left_out_lines():
    freq, damping = field_machine().modes()
    values, coherence = measured()
    hum = values.copy()
    hum[98:101] += 0.3 * np.abs(values).max()  # 49.5 to 50.5 Hz
    write_case(
        "modes/mains_hum",
        "mains hum at 50 Hz in FRFs without a sign of it in the coherence",
        "ignore_hz leaves these lines out; then the modes",
        [identify("--json", "r.json", value=modes_are(freq, damping))],
        array_files(hum, coherence, top="ignore_hz = [[49.0, 51.0]]"),
    )
    write_case(
        "modes/ignore_nothing",
        "ignore_hz with its ends exchanged",
        "exit 3",
        [identify(exit_code=3, says=["ignore_hz"])],
        array_files(values, coherence, top="ignore_hz = [[51.0, 49.0]]"),
    )
