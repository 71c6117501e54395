"""A campaign of a small machine with a torque, a motor and rotation channels among its tests.

The data come from the machine's own equation, with draws of springs and tolerances, and with one
effect if asked for: what a fit leaves is noise, and what it finds can be held against the truth.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from identification.words import Dof, Input, Signal
from mbmodel import Evaluator, FrfRequest, Model, load_machine
from tests.helpers.small_machine import MJCF

AVERAGES = 20
LABELS = ("3:+x", "3:-y", "3:+z", "3:+rz", "drive")
REFERENCES: tuple[Input, ...] = (
    Dof("acc3", "+tx"),
    Dof("acc3", "-ty"),
    Dof("acc3", "+tz"),
    Dof("acc3", "+rz"),
    Signal("drive"),
)
TURNING = (Dof("acc1", "+ry"), Dof("acc4", "+rz"), Dof("acc6", "-rz"))
OUTPUTS = (*(Dof.of(f"acc{k}", axis) for k in range(1, 7) for axis in range(3)), *TURNING)
MOTOR = '<actuator><motor name="drive" joint="head_rz" gear="2.5"/></actuator></mujoco>'


def write_torque_campaign(
    folder: Path,
    parts: Callable[[object], tuple],
    *,
    changed: Mapping[str, float] | None = None,
    spread: float = 0.1,
    labels: tuple[str, ...] = LABELS,
    extra: str = "",
    factors: Mapping[str, float] | None = None,
    drives: Mapping[str, float] | None = None,
    force_delay: float = 0.0,
    seed: int = 3,
    lines: int = 160,
    noise: float = 0.01,
) -> dict[str, float]:
    """Write model.xml, test.npz and campaign.toml; return the parameters that made the data.

    Args:
        folder: where.
        parts: what the truth has as Parts, of a machine.
        changed: values of some parameters.
        spread: standard deviation of the logarithm of stiffness and damping.
        labels: references, a choice of ``LABELS``.
        extra: further lines of campaign.toml.
        factors: what channels read per SI unit, by label such as ``acc4:+tx``.
        drives: factor of the FRFs of references, by their labels.
        force_delay: delay of all FRFs [s], negative for a force channel that lags.
        seed: of the draws.
        lines: number of lines.
        noise: of each channel, over its rms.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(MJCF.replace("</mujoco>", MOTOR), encoding="utf-8")
    machine = load_machine(folder / "model.xml")
    model = Model(machine, parts(machine))
    random = np.random.default_rng(seed)
    names = [parameter.name for parameter in model.parameters]
    theta = model.drawn.copy()
    for k, parameter in enumerate(model.parameters):
        if parameter.known == "free" and parameter.positive:
            theta[k] *= np.exp(random.normal(0, spread))
        theta[k] = (changed or {}).get(parameter.name, theta[k])
    freq = np.linspace(5.0, 165.0, lines)
    inputs = tuple(REFERENCES[LABELS.index(label)] for label in labels)
    values = Evaluator(model, FrfRequest(freq, OUTPUTS, inputs)).at(theta).values
    rms = np.sqrt((np.abs(values) ** 2).mean(axis=0))
    sigma = np.maximum(noise * rms, 1e-3 * noise * rms.max(axis=0))
    error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
    noisy = values + error[0] + 1j * error[1]
    ratio = (AVERAGES - 1) * sigma**2 / np.abs(noisy) ** 2
    noisy = noisy * np.array([(factors or {}).get(str(dof), 1.0) for dof in OUTPUTS])[:, None]
    noisy = noisy * np.array([(drives or {}).get(label, 1.0) for label in labels])
    noisy = noisy * np.exp(-2j * np.pi * force_delay * freq)[:, None, None]
    np.savez(folder / "test.npz", frf=noisy, coherence=1 / (1 + ratio), freq_hz=freq)
    channels = [str(dof).removeprefix("acc") for dof in OUTPUTS]
    (folder / "campaign.toml").write_text(
        'model = "model.xml"\n[[test]]\nfile = "test.npz"\n'
        f"averages = {AVERAGES}\nchannels = {channels}\nreferences = {list(labels)}\n{extra}",
        encoding="utf-8",
    )
    return dict(zip(names, theta.tolist(), strict=True))
