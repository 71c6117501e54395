"""The identified station: made anew, its 16 modes by an eigenproblem of MuJoCo's own matrices."""

import importlib
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import scipy.linalg

from identification.readers.mode_table import read_mode_table
from mbmodel import as_drawn, energy_shares, load_machine, model_modes

HERE = Path(__file__).resolve().parents[2] / "assets" / "microstation"
IDENTIFIED = HERE / "station_identified.xml"


@pytest.fixture(scope="module")
def maker():
    """The script that makes the identified station."""
    before, written = sys.path[:], sys.dont_write_bytecode
    sys.path.insert(0, str(HERE))
    sys.dont_write_bytecode = True  # or a wheel that is built later would carry it
    yield importlib.import_module("make_identified")
    sys.path[:], sys.dont_write_bytecode = before, written


@pytest.fixture(scope="module")
def station():
    return as_drawn(load_machine(IDENTIFIED))


@pytest.fixture(scope="module")
def table():
    return read_mode_table(HERE / "modes.csv").modes


def poles_by_mujoco():
    """Poles with Im > 0 of [[0, 1], [-M^-1 K, -M^-1 C]], matrices from MuJoCo alone."""
    model = mujoco.MjModel.from_xml_path(str(IDENTIFIED))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    stiffness, damping = (np.ravel(values)[: model.nv] for values in _coefficients(model))
    zero, unit = np.zeros((model.nv,) * 2), np.eye(model.nv)
    state = np.block(
        [
            [zero, unit],
            [-np.linalg.solve(mass, np.diag(stiffness)), -np.linalg.solve(mass, np.diag(damping))],
        ]
    )
    poles = scipy.linalg.eigvals(state)
    poles = poles[poles.imag > 0]
    return poles[np.argsort(np.abs(poles))]


def _coefficients(model):
    """Linear coefficients of the joints, each a slide or a hinge with one coordinate."""
    assert model.njnt == model.nv
    stiffness, damping = model.jnt_stiffness, model.dof_damping
    return stiffness.reshape(model.njnt, -1)[:, 0], damping.reshape(model.nv, -1)[:, 0]


def test_it_has_16_modes_below_200_hz_at_the_measured_frequencies(table):
    poles = poles_by_mujoco()
    frequencies = np.abs(poles) / (2 * np.pi)
    measured = np.array([mode.freq_hz for mode in table])
    assert (frequencies < 200.0).sum() == len(table) == 16
    np.testing.assert_allclose(frequencies[:16], measured, rtol=0.03)
    # The three that the report names.
    named = [0, 5, 12]
    np.testing.assert_allclose(measured[named], [11.9, 69.8, 124.2])
    np.testing.assert_allclose(frequencies[named], measured[named], rtol=0.02)
    damping = -poles.real / np.abs(poles)
    np.testing.assert_allclose(damping[:16], [mode.damping for mode in table], rtol=0.3)


def test_the_first_mode_is_a_tilt_of_the_granite_on_its_levelers(station):
    shares = energy_shares(station, station.drawn, model_modes(station, station.drawn))
    tilts = [shares.springs.index(f"granite_bottom_{axis}") for axis in ("rx", "ry")]
    assert shares.strain[tilts, 0].sum() > 0.5


def test_the_sixth_mode_is_vertical_and_the_spindle_moves_most(station):
    shares = energy_shares(station, station.drawn, model_modes(station, station.drawn))
    assert shares.motions[int(shares.kinetic[:, 5].argmax())] == "spindle:tz"


def test_the_thirteenth_mode_is_a_lateral_resonance_of_the_hexapod(station):
    shares = energy_shares(station, station.drawn, model_modes(station, station.drawn))
    assert shares.motions[int(shares.kinetic[:, 12].argmax())] in ("hexapod:tx", "hexapod:ty")
    assert max(shares.by_body(), key=lambda body: shares.by_body()[body][12]) == "hexapod"


def test_masses_and_geometry_are_those_of_the_drawing(station):
    drawn = load_machine(HERE / "station.xml")
    np.testing.assert_array_equal(station.machine.body_mass, drawn.body_mass)
    np.testing.assert_array_equal(station.machine.jacobian, drawn.jacobian)


def test_a_search_from_the_committed_parameters_ends_there_with_these_figures(maker, station):
    tuned = maker.identify(starts=1)
    assert tuned.fit.outcome == "converged"
    values = dict(zip((p.name for p in tuned.model.parameters), tuned.fit.theta, strict=True))
    for parameter in station.parameters:
        assert parameter.drawn == pytest.approx(values[parameter.name], rel=1e-6), parameter.name
    text = (HERE / "README.md").read_text(encoding="utf-8")
    assert maker.with_figures(text, tuned) == text
