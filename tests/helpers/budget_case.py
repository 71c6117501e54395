"""A machine of two masses, and an error budget of it with a loop and correlated sources."""

import json

import numpy as np

from mbmodel import load_machine, machine_model
from tuning import ParameterPosterior
from tuning.files.posterior_file import write_posterior
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.loop_margins import plant_margins
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.read_definition import read_definition

TWO = """
<mujoco model="two"><option gravity="0 0 0"/><worldbody>
  <body name="base"><inertial pos="0 0 0" mass="{m1}" diaginertia="1 1 1"/>
    <joint name="base_tx" type="slide" axis="1 0 0" stiffness="{k1}" damping="{c1}"/>
    <site name="acc1" pos="0 0 0"/>
    <body name="head"><inertial pos="0 0 0.2" mass="{m2}" diaginertia="1 1 1"/>
      <joint name="head_tx" type="slide" axis="1 0 0" stiffness="{k2}" damping="{c2}"/>
      <site name="acc2" pos="0 0 0.2"/>
    </body></body></worldbody>
  <actuator><motor name="drive" joint="head_tx" gear="2"/></actuator></mujoco>
"""
VALUES = {"m1": 30.0, "k1": 9e5, "c1": 400.0, "m2": 8.0, "k2": 7e4, "c2": 40.0}
BUDGET = """
band = [2.0, 45.0]
[error.top]
output = "acc2:+tx"
minus = "acc1:+tx"
[error.base]
output = "acc1:+tx"
unit = "um"
[disturbance.floor]
input = "floor:+tx"
csv = "floor.csv"
[disturbance.ripple]
input = "drive"
density = 0.3
unit = "1^2/Hz"
{lines}
[noise.encoder]
loop = "axis"
density = 2e-7
unit = "m/sqrt(Hz)"
[loop.axis]
input = "drive"
output = "acc2:+tx"
minus = "acc1:+tx"
delay = {delay}
controller = {{zeros = [-60.0, -8.0], poles = [-0.5, -700.0], gain = {gain}}}
[[correlation]]
between = ["floor", "ripple"]
coherence = 0.6
phase_deg = 40.0
"""
FLOOR_HZ, FLOOR = np.array([1.0, 9.0, 60.0]), np.array([1e-4, 4e-3, 8e-4])


def write_machine(place):
    """Write the machine and the spectrum of the floor's acceleration; return the folder."""
    (place / "two.xml").write_text(TWO.format(**VALUES), encoding="utf-8")
    write_floor(place, ";")
    return place


def write_floor(place, separator):
    """Write the spectrum of the floor's acceleration."""
    rows = [f"{f}{separator}{s}" for f, s in zip(FLOOR_HZ, FLOOR, strict=True)]
    text = "\n".join([f"f{separator}x [(m/s^2)^2/Hz]", *rows])
    (place / "floor.csv").write_text(text + "\n", encoding="utf-8")


def write_tuned_case(place, extra=""):
    """Write a tuned machine with its posterior, its nominal one, and a budget with a loop."""
    (place / "two.xml").write_text(TWO.format(**{**VALUES, "k1": 7e5}), encoding="utf-8")
    (place / "campaign.toml").write_text('model = "two.xml"\n', encoding="utf-8")
    tuned = place / "x-tuned"
    tuned.mkdir()
    (tuned / "tuned.xml").write_text(TWO.format(**VALUES), encoding="utf-8")
    record = {"tuned.xml": {"verb": "tune", "source": "../campaign.toml"}}
    (tuned / ".mbw.json").write_text(json.dumps(record), encoding="utf-8")
    model = machine_model(load_machine(tuned / "tuned.xml"))
    names = tuple(p.name for p in model.parameters[:4])
    posterior = ParameterPosterior(
        names, names, model.drawn[:4], np.arange(4), np.ones(4), np.ones(4, bool),
        0.03**2 * np.eye(4), 0.02, 0.01,
    )  # fmt: skip
    write_posterior(posterior, tuned / "posterior.npz")
    write_floor(place, ",")
    text = BUDGET.format(gain=3e5, delay=3e-4, lines="") + extra
    (place / "budget.toml").write_text(text, encoding="utf-8")


LOOP_DELAY = 3e-4
SECOND_LOOP = """
[loop.base]
input = "acc1:+tx"
output = "acc1:+tx"
quantity = "mobility"
controller = { poles = [-400.0], gain = 4e5 }
"""


def spring_posterior(model, deviation=0.03, discrepancy=0.01):
    """All springs and dampers, independent."""
    names = tuple(parameter.name for parameter in model.parameters[:4])
    return ParameterPosterior(
        names, names, model.drawn[:4], np.arange(4), np.ones(4), np.ones(4, bool),
        deviation**2 * np.eye(4), 0.02, discrepancy,
    ).on(model)  # fmt: skip


def loop_definition(folder, model, extra="", gain=3e5):
    file = folder / "budget.toml"
    file.write_text(BUDGET.format(gain=gain, delay=LOOP_DELAY, lines="") + extra, encoding="utf-8")
    return read_definition(file, model.machine)


def margins_of(budget, **known):
    """Return the margins of a budget's loops; ``known`` as ``plant_margins`` takes it."""
    plant = LoopPlant.of(budget.linearised.model, budget.definition)
    return plant_margins(plant, budget.linearised.theta, **known)


def open_loop(theta=None):
    """GK of both loops by hand as a function of s: axis, then base."""
    m1, k1, c1, m2, k2, c2 = VALUES.values() if theta is None else theta

    def gain_of(s):
        dynamic = np.array(
            [
                [m1 * s**2 + (c1 + c2) * s + k1 + k2, -c2 * s - k2],
                [-c2 * s - k2, m2 * s**2 + c2 * s + k2],
            ]
        )
        forces = np.array([[-2.0, 1.0], [2.0, 0.0]])  # drive has a gear of 2
        reading = np.array([[-1.0, 1.0], [s, 0.0]])
        axis = 3e5 * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700)) * np.exp(-s * LOOP_DELAY)
        return reading @ np.linalg.solve(dynamic, forces) * np.array([axis, 4e5 / (s + 400)])

    return gain_of


def loop_gain_by_hand(freq, theta=None):
    gain_of = open_loop(theta)
    return np.array([gain_of(2j * np.pi * f) for f in freq])


def sample_rms(budget, thetas):
    """Return the rms errors of machines by a budget of each; (n_sample, n_error)."""
    model = budget.linearised.model
    return np.array([error_budget(model, theta, budget.definition).rms for theta in thetas])
