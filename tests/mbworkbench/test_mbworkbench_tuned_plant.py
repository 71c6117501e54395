"""``mb.read_plant``: bands, state spaces and the uncertain plant from the folder of a tuning."""

import numpy as np
import pytest
from campaign_folder import write_folder

import mbworkbench as mb

FREQ = np.linspace(5.0, 150.0, 40)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    folder = write_folder(tmp_path_factory.mktemp("facade") / "campaign")
    model = mb.read_model(folder / "model.xml")
    tuned = mb.tune(mb.read_campaign(folder), model=model)
    tuned.write(folder / "tuned")
    return mb.read_plant(folder / "tuned", "acc3:+tx", ["acc4:+tx", "base:+ry"], FREQ, "mobility")


def response(system, points):
    return np.array([system(point, squeeze=False) for point in points])


def test_a_plant_has_bands_states_and_alternatives(plant):
    bands = plant.bands()
    assert bands.values.shape == (40, 1, 2)
    low, high = bands.magnitude_interval()
    assert (low < high).all()
    s = 2j * np.pi * FREQ
    peak = np.abs(bands.values).max(axis=0)
    whole = plant.state_space(delays_s=[0.0, 3e-4])
    assert f"{len(whole.states)} states, continuous, " in repr(whole)
    assert repr(whole).endswith("delays 0, 0.0003 s")
    timely = plant.state_space().to_control()
    assert (np.abs(response(timely, s) - bands.values) < 1e-6 * peak).all()
    reduced = whole.reduce(bands=bands)
    assert reduced.largest_error <= reduced.relative_bound
    error = f"from {len(whole.states)} with an error of {reduced.largest_error:.2g} of the largest"
    assert error in repr(reduced)
    error = np.abs(response(plant.state_space().reduce(bands=bands).to_control(), s) - bands.values)
    assert (error <= (high - low) / 6 + 1e-6 * peak).all()
    system = reduced.sample(1e-4).to_control()
    assert system.dt == 1e-4
    values = response(system, np.exp(s * 1e-4))
    late = np.exp(-s[:, None] * (np.array([0.0, 3e-4]) + 0.5e-4))[:, None]
    assert (np.abs(values - bands.values * late) < 0.05 * peak).all()
    uncertain = plant.uncertain()
    z = plant.posterior.posterior.draw(1, seed=0)[0]
    assert not np.allclose(response(uncertain.sample(z), s), bands.values, rtol=1e-6)
    assert "mobility" in repr(plant)


@pytest.mark.parametrize("delays", [[-1e-3, 0.0], [np.nan, 0.0], [1e-3], [1e-3, 0.0, 0.0]])
def test_delays_that_are_none_are_refused(plant, delays):
    with pytest.raises(mb.UsageError, match="are no delays of 2 inputs: give each input one"):
        plant.state_space(delays_s=delays)


def test_delays_in_continuous_time_have_no_system_of_python_control(plant):
    with pytest.raises(mb.UsageError, match=r"no delays in continuous time: call sample"):
        plant.state_space(delays_s=[0.0, 3e-4]).to_control()
