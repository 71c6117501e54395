"""A campaign of the servo axis: a hammer and a motor, noise that differs between channels."""

import numpy as np
from any_machines import SERVO_AXIS

from identification.words import Dof, Signal
from mbmodel import FrfRequest, as_drawn, linearise, load_machine

CHANNELS = ["acc1:+tx", "acc1:-tz", "acc4:+tx", "acc4:+ty", "acc5:+tz", "acc3:+tx"]
REFERENCES = {"hit6:+tx": ("tap", 30.0), "servo": ("", None), "acc2:-tz": ("tap", 30.0)}
FREQ = np.arange(5.0, 150.0, 1.0)
AVERAGES = 9


def write_servo_campaign(folder):
    """Write the campaign into a folder, and return it."""
    (folder / "axis.xml").write_text(SERVO_AXIS)
    model = as_drawn(load_machine(folder / "axis.xml"))
    random = np.random.default_rng(4)
    lines = ['model = "axis.xml"']
    for number, (reference, (hammer, level)) in enumerate(REFERENCES.items()):
        question = request(FREQ, reference)
        frf = linearise(model, model.drawn, question).values
        sd = noise_of(number, frf)
        frf = frf + sd * (random.standard_normal((2, *frf.shape)).T @ [1, 1j]).T / np.sqrt(2)
        power = np.abs(frf) ** 2
        coherence = power / (power + sd**2 * (AVERAGES - 1))
        np.savez(folder / f"{number}.npz", freq_hz=FREQ, frf=frf, coherence=coherence)
        lines += ["[[test]]", f'file = "{number}.npz"', f"averages = {AVERAGES}"]
        lines += [f"channels = {CHANNELS}", f'references = ["{reference}"]']
        lines += ['quantity = "accelerance"', 'unit = "m/s^2/N"']
        lines += [f'hammer = "{hammer}"'] * bool(hammer) + [f"level = {level}"] * bool(level)
    lines += ["[tolerance]", "mass = 0.01", "sensor_position = 0.0005", "hammer_gain = 0.03"]
    (folder / "campaign.toml").write_text("\n".join(lines))
    return folder


def request(freq, reference):
    """Ports by their labels: a motor has no colon."""
    port = Dof.parse(reference) if ":" in reference else Signal(reference)
    return FrfRequest(freq, tuple(Dof.parse(label) for label in CHANNELS), (port,))


def noise_of(number, frf):
    """Standard deviations that grow from channel to channel and from reference to reference."""
    size = np.sqrt(np.mean(np.abs(frf) ** 2))
    return 0.002 * size * (1 + number) * (1 + np.arange(len(CHANNELS)))[None, :, None]
