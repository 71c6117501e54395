"""Cases on tests with one thing wrong, and on advice that only holds where rivals are excluded."""

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from tests.field.make_inputs.folder import (
    CHANNELS,
    REFERENCES,
    array_files,
    campaign,
    identify,
    measured,
    modes_are,
    npz,
    write_case,
)
from tests.field.virtual_machine import FREQ_HZ, NOISE, field_machine, layout_text, model_text

AVERAGES = 20


def write():
    """Write all cases of this module."""
    _several_inputs()
    _dead_in_one_test()
    _hits_in_order()
    _wrong_models()


def _complex_normal(rng, *shape):
    return rng.normal(size=(*shape, 2)) @ [1, 1j] / np.sqrt(2)


def _shaken_at_once():
    """Return H1 of two correlated random forces, multiple coherence of each output, and S_xx."""
    rng = np.random.default_rng(11)
    exact = field_machine().accelerance()
    forces = np.array([[1.0, 0.0], [1.2, 0.6]]) @ _complex_normal(rng, len(FREQ_HZ), 2, AVERAGES)
    motion = exact @ forces
    deviation = 10 * NOISE * np.median(np.abs(motion), axis=(0, 2))[:, None]
    motion += deviation * _complex_normal(rng, *motion.shape)
    adjoint = forces.conj().swapaxes(1, 2)
    s_xx, s_yx = forces @ adjoint / AVERAGES, motion @ adjoint / AVERAGES
    values = s_yx @ np.linalg.inv(s_xx)
    explained = np.einsum("foi,foi->fo", values, s_yx.conj()).real
    multiple = explained / (np.abs(motion) ** 2).mean(axis=2)
    coherence = np.repeat(multiple[:, :, None], 2, axis=2)
    return values.astype(np.complex64), coherence.astype(np.float32), s_xx.astype(np.complex64)


def _several_inputs():
    values, coherence, s_xx = _shaken_at_once()
    test = (
        f'file = "t.npz"\naverages = {AVERAGES}\n{CHANNELS}\n{REFERENCES}\nquantity = "accelerance"'
    )
    solid = "it moves as a solid up to 110 hz"
    values_right = modes_are(field_machine().modes()[0])
    run = identify("--json", "r.json", says=[solid], never=["may be missing"], value=values_right)
    write_case(
        "advice/multiple_coherence",
        "two shakers at once, with the multiple coherence and no word about it",
        "the body is solid, the noise comes from neighbouring lines, and the key is named",
        [{**run, "says": [solid, 'coherence = "multiple"', "input_spectra"]}],
        array_files(values, coherence, test),
    )
    files = array_files(values, coherence, test + '\ncoherence = "multiple"')
    arrays = {"frf": values, "coherence": coherence, "freq_hz": FREQ_HZ, "input_spectra": s_xx}
    write_case(
        "advice/input_spectra",
        "two shakers at once, with the multiple coherence and the spectra of both forces",
        "the body is solid, and each cell has its noise",
        [{**run, "never": ["may be missing", "third differences"]}],
        {**files, "t.npz": npz(**arrays)},
    )


def _dead_in_one_test():
    values, coherence = measured()
    rng = np.random.default_rng(12)
    values[:, 3, 1] = 1e-3 * np.median(np.abs(values[:, 3, 0])) * _complex_normal(rng, len(FREQ_HZ))
    coherence[:, 3, 1] = rng.beta(1, 9, len(FREQ_HZ))  # of noise from ten hits
    write_case(
        "advice/dead_in_one_test",
        "the cable of a sensor is off in one of two tests",
        "the channel is named and left out there, and the body is solid",
        [
            identify(
                "--json",
                "r.json",
                says=["acc4:+tz read noise alone if hit at acc3:+tz", "left out there", "solid up"],
                never=["flexible", "a wrong gain"],
                value=modes_are(field_machine().modes()[0]),
            )
        ],
        array_files(values, coherence),
    )


def _eight_hits():
    """Return the records of eight hits on sensor 1 of the field machine."""
    # The helpers are on the path only while inputs are written.
    from hammer_records import Hammer, System, strike  # noqa: PLC0415

    machine = field_machine()
    omega_squared, vectors = eigh(machine.K, machine.M)
    shapes = machine.S @ vectors
    damping = np.diag(vectors.T @ machine.C @ vectors) / (2 * np.sqrt(omega_squared))
    system = System(np.sqrt(omega_squared) / (2 * np.pi), damping, shapes, shapes[0])
    hammer = Hammer(
        rate_hz=400.0,
        duration_s=2.5,
        pulse_s=0.008,
        times_s=tuple((0.1 + 0.0003 * k,) for k in range(8)),
        noise=2e-3,
        outputs=tuple(f"{n}:+z" for n in range(1, 6)),
        reference="1:+z",
    )
    return strike(system, hammer)


def _hits_in_order():
    records = _eight_hits()
    dead = records.motion.copy()
    rng = np.random.default_rng(13)
    dead[3:, 3] = 2e-3 * rng.normal(size=dead[3:, 3].shape)
    growing = records.motion * (1 + 5e-3 * np.arange(8))[:, None, None]
    for name, situation, expected, motion, says in (
        (
            "cable_breaks",
            "the cable of a sensor breaks after the third of eight hits",
            "the channel is named and left out, and no law of a joint is",
            dead,
            "acc4:+tz is dead in most of the hits",
        ),
        (
            "gain_drifts",
            "a charge amplifier drifts by half a per cent from hit to hit",
            "a drift with the number of the hit, and no law of a joint",
            growing,
            "from hit to hit",
        ),
    ):
        _write_records(f"advice/{name}", situation, expected, replace(records, motion=motion), says)


def _write_records(name, situation, expected, records, says):
    arrays = {
        "force": records.force.astype(np.float32),
        "response": records.motion.astype(np.float32),
        "rate_hz": records.rate_hz,
    }
    test = f'file = "t.npz"\n{CHANNELS}\nreferences = ["1:+z"]\nquantity = "accelerance"'
    run = identify(
        "--json", "r.json", says=[says], never=["friction", "Jenkins", "backlash", "gap"]
    )
    write_case(
        name,
        situation,
        expected,
        [{**run, "value": modes_are(field_machine().modes()[0])}],
        {"campaign.toml": campaign(test), "layout.toml": layout_text(), "t.npz": npz(**arrays)},
    )


def _wrong_models():
    values, coherence = measured()
    tune = ["tune", ".", "--out", "out"]
    grams = model_text()
    for number in ("60", "25"):
        grams = grams.replace(f'mass="{number}"', f'mass="{number}000"')
    for inertia in ("2 2 3", "0.9 1.3 1.9"):
        thousand = " ".join(f"{1000 * float(number):g}" for number in inertia.split())
        grams = grams.replace(f'diaginertia="{inertia}"', f'diaginertia="{thousand}"')
    write_case(
        "advice/masses_in_grams",
        "the masses of the model are in grams",
        "refused before the fit, with the masses among the reasons",
        [{"command": tune, "exit_code": 3, "says": ["masses and inertias of the model by 1000"]}],
        {**array_files(values, coherence, model=True), "model.xml": grams},
    )
    reversed_channel = values.copy()
    reversed_channel[:, 4] *= -1
    write_case(
        "advice/reversed_channel",
        "a channel reads with the wrong sign, and the model is right",
        "the channel is named, and no other tolerance is blamed",
        [{"command": [*tune, "--no-pictures"], "says": ["acc5 reads as if", "channel tz is -tz"],
          "never": ["implausible"]}],
        array_files(reversed_channel, coherence, model=True),
    )  # fmt: skip
    decibels = 20 * np.log10(np.abs(values) / 1e-6) * np.exp(1j * np.angle(values))
    write_case(
        "advice/decibels_with_phase",
        "magnitudes in decibels (re 1e-6 m/s^2/N) with a phase",
        "refused before the fit as decibels, not as a unit",
        [{"command": tune, "exit_code": 3, "says": ["decibels", "export linear"],
          "never": ["lbf"]}],
        array_files(decibels.astype(np.complex64), coherence, model=True),
    )  # fmt: skip
