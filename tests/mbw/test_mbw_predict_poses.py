"""``mbw predict --poses``: grids of poses and spin rates, their files and messages."""

import json
from functools import partial

import numpy as np
import pytest
import scipy.io

from mbmodel import as_drawn, load_machine, model_modes
from tests.helpers import command

run = partial(command.run, "predict")

CART = """
<mujoco model="cart"><option gravity="0 0 0"/><worldbody>
  <body name="beam"><inertial pos="0 0 0" mass="5" diaginertia="0.3 0.3 0.5"/>
    <joint name="beam_rz" type="hinge" axis="0 0 1" stiffness="9e3" damping="2"/>
    <body name="cart"><inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
      <joint name="cart_tx" type="slide" axis="1 0 0" stiffness="8e4" damping="20"/>
      <site name="acc1" pos="0 0 0"/></body></body></worldbody></mujoco>
"""
BUDGET = """
[error.x]
output = "acc1:+tx"
[noise.n]
loop = "x"
density = 1.0
unit = "nm/sqrt(Hz)"
band = [1, 50]
[loop.x]
input = "joint:cart_tx"
output = "joint:cart_tx"
controller = { poles = [-900.0], gain = 1e6 }
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = tmp_path_factory.mktemp("cart")
    (place / "cart.xml").write_text(CART)
    (place / "budget.toml").write_text(BUDGET)
    (place / "poses.csv").write_text("cart_tx\n0\n0.2\n0.5\n")
    return place


def load(file):
    with np.load(file) as arrays:
        return {name: arrays[name] for name in arrays}


def test_a_stroke_is_written_as_a_grid(place):
    ports = ("--input", "acc1:+ty", "--output", "acc1:+ty", "--lines", "20")
    out, row = place / "out", place / "grid.json"
    options = ("--budget", place / "budget.toml", "--out", out, "--json", row)
    said = run(place / "cart.xml", "--poses", "cart_tx=0:0.5:3", *ports, *options)
    assert "3 points" in said
    assert "worst pose: cart_tx = " in said
    written, arrays = json.loads(row.read_text()), load(out / "poses.npz")
    matlab = scipy.io.loadmat(out / "poses.mat")
    np.testing.assert_array_equal(arrays["poses"][:, 0], [0, 0.25, 0.5])
    np.testing.assert_array_equal(matlab["A"], arrays["A"])
    for number, pose in enumerate(arrays["poses"][:, 0]):
        # The cart on the beam turns with it: its inertia about the hinge is I + m x^2.
        hinge = np.sqrt(9e3 / (0.5 + 0.01 + 2 * pose**2)) / (2 * np.pi)
        assert np.abs(arrays["mode_freq_hz"][number] / hinge - 1).min() < 1e-3
        s = 2j * np.pi * arrays["freq_hz"]
        a, b, c, d = (arrays[name][number] for name in "ABCD")
        values = [(c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d)[0, 0] for z in s]
        np.testing.assert_allclose(arrays["frf"][number, :, 0, 0], values, rtol=1e-6)
        loop = written["points"][number]["loops"][0]
        assert loop["modulus"] == pytest.approx(arrays["modulus"][number])
    assert written["worst"] == int(np.argmin(arrays["modulus"]))


def test_poses_of_a_file_are_those_of_the_range(place):
    said = run(place / "cart.xml", "--poses", place / "poses.csv", "--out", place / "file")
    assert "3 points" in said
    arrays = load(place / "file" / "poses.npz")
    model = as_drawn(load_machine(place / "cart.xml", pose={"cart_tx": 0.5}))
    modes = model_modes(model, model.drawn)
    np.testing.assert_allclose(np.sort(arrays["mode_freq_hz"][-1]), np.sort(modes.freq_hz))


@pytest.mark.parametrize(
    ("options", "words", "code"),
    [
        (("--poses", "cart_tx=0:1"), "write JOINT=FROM:TO:N", 2),
        (("--poses", "cart_tx=0:1:3", "--poses", "cart_tx=0:1:3"), "name a joint twice", 2),
        (("--poses", "cart_tx=0:1:9999"), "at most 2000", 2),
        (("--poses", "cart_tx=0:1:3", "--bands"), "predict a single pose", 2),
        (("--poses", "wagon=0:1:3"), "no slide or hinge of the model", 3),
        (("--spin", "beam_rz=0:1"), "--spin 'beam_rz=0:1': write JOINT=FROM:TO:N", 2),
    ],
)
def test_what_is_no_grid_is_refused(place, options, words, code):
    assert words in run(place / "cart.xml", *options, "--out", place / "refused", code=code)
