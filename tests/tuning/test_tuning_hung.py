"""A bob on a wire, measured by its closed form: its stiffness is tuned, its tension stays."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.io
from hung_machines import Bob

from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine, model_edits, write_mjcf
from tuning import open_session, tune
from tuning.files.result import summarise_tuning

FREQ = np.arange(0.25, 40.01, 0.25)
DRAWN = Bob()
TRUE = replace(DRAWN, stiffness=1.5 * DRAWN.stiffness, wire_damping=30.0)
CAMPAIGN = """\
model = "model.xml"

[[test]]
file = "impact.mat"
averages = 10
channels = ["1:+x", "1:+z", "2:+x", "2:+z"]
references = ["1:+x", "1:+z"]

[tolerance]
mass = 0.001
inertia = 0.001
com = 1e-5
joint_position = 0
sensor_gain = 0.001
sensor_angle = 0
sensor_position = 0
sensor_delay = 0
sensor_cross = 0
hammer_angle = 0
hammer_position = 0
hammer_gain = 1e-3
hammer_delay = 0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A campaign of the true bob with 1 % noise, whose model is the drawn one."""
    folder = tmp_path_factory.mktemp("hung")
    (folder / "model.xml").write_text(DRAWN.text(), encoding="utf-8")
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    values, random = TRUE.accelerances(FREQ), np.random.default_rng(3)
    sigma = 0.01 * np.abs(values) + 1e-4
    error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
    noisy = values + error[0] + 1j * error[1]
    coherence = 1 / (1 + 9 * sigma**2 / np.abs(noisy) ** 2)
    data = {"FRFs": np.moveaxis(noisy, 0, 2), "COHs": np.moveaxis(coherence, 0, 2), "freqs": FREQ}
    scipy.io.savemat(folder / "impact.mat", data)
    return folder


@pytest.fixture(scope="module")
def tuned(folder):
    """The drawn bob, tuned to it."""
    return tune(open_session(folder, (0.25, 40.0)))


def test_the_stiffness_of_the_wire_is_found_and_the_gap_closes(tuned):
    found = summarise_tuning(tuned)
    rows = {row.name: row for row in found.parameters}
    wire = rows["wire.stiffness"]
    assert wire.low < TRUE.stiffness < wire.high
    assert wire.high / wire.low < 1.02
    assert found.gap.sensors.as_drawn.excess > 5
    assert found.gap.sensors.tuned.excess < 1.1


def test_tuned_xml_loaded_anew_answers_as_the_tuned_parameters(tuned, tmp_path):
    # Sensors and hits keep their places here: an MJCF does not hold all of their errors.
    model = tuned.session.model
    mechanical = [part.location.startswith(("joint:", "tendon:", "body:")) for part in model.parts]
    chosen = np.repeat(mechanical, [len(part.parameters) for part in model.parts])
    theta = np.where(chosen, tuned.model_fit.theta, model.drawn)
    assert not write_mjcf(model.machine.source, tmp_path / "tuned.xml", model_edits(model, theta))
    again = as_drawn(load_machine(tmp_path / "tuned.xml"))
    request = FrfRequest(FREQ, tuned.session.campaign.outputs, tuned.session.campaign.inputs)
    values, expected = (
        Evaluator(of, request).at(at_theta).values
        for of, at_theta in ((model, theta), (again, again.drawn))
    )
    assert np.abs(values - expected).max() < 1e-6 * np.abs(expected).max()
