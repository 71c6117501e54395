"""Transmissibilities: tests in which the floor moves the machine, and no force is measured."""

import numpy as np
import pytest

from identification import read_campaign, read_settings
from identification.words import Dof, InputError, parse_port
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from tests.helpers.small_machine import MJCF
from tuning import fit, open_session

FLOORS = ("floor:+tx", "floor:+tz")
OUTPUTS = tuple(Dof.of(f"acc{k}", axis) for k in (1, 3, 4, 6) for axis in (0, 2))
IN_PLANE = ("base_tx", "base_tz", "base_ry", "head_tx")  # what x and z show
TOML = """\
model = "model.xml"
[[test]]
file = "{file}"
channels = [{channels}]
references = [{references}]
"""


def write(folder, file, references=FLOORS):
    folder.mkdir(exist_ok=True)
    (folder / "model.xml").write_text(MJCF, encoding="utf-8")
    names = (", ".join(f'"{each}"' for each in side) for side in (OUTPUTS, references))
    channels, inputs = names
    text = TOML.format(file=file, channels=channels, references=inputs)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


def transmissibility(folder, freq_hz, stiffer=1.0):
    model = as_drawn(load_machine(folder / "model.xml"))
    names = [parameter.name for parameter in model.parameters]
    theta = model.drawn * [stiffer if "stiffness" in name else 1.0 for name in names]
    inputs = tuple(map(parse_port, FLOORS))
    return Evaluator(model, FrfRequest(freq_hz, OUTPUTS, inputs, "accelerance")).at(theta).values


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """FRFs of a machine whose springs are 20 % stiffer, with 1 % noise."""
    folder = write(tmp_path_factory.mktemp("table"), "frf.npz")
    freq_hz = np.linspace(5.0, 165.0, 200)
    values = transmissibility(folder, freq_hz, 1.2)
    deviation = 0.01 * np.abs(values).mean(axis=0)
    drawn = np.random.default_rng(3).standard_normal((2, *values.shape)) / np.sqrt(2)
    noisy = values + deviation * (drawn[0] + 1j * drawn[1])
    variance = np.broadcast_to(deviation**2, values.shape)
    np.savez(folder / "frf.npz", freq_hz=freq_hz, frf=noisy, variance=variance)
    return folder


def test_stiffness_follows_from_transmissibilities_alone(table):
    session = open_session(table)
    (instrument,) = {test.condition.instrument for test in session.campaign.tests}
    assert instrument == "floor"
    assert {test.condition.drive_unit for test in session.campaign.tests} == {"m/s^2"}
    assert session.known_force_tolerance is None  # masses set the scale
    fitted = fit(session.model, session.campaign, parametrisation=session.parametrisation)
    for k, parameter in enumerate(session.model.parameters):
        if parameter.known == "stiffness" and parameter.name.split(".")[0] in IN_PLANE:
            assert fitted.theta[k] == pytest.approx(1.2 * parameter.drawn, rel=0.05)


def test_records_of_the_floor_become_transmissibilities(tmp_path):
    folder, rate_hz, samples = write(tmp_path / "records", "records.npz", FLOORS[:1]), 512.0, 4096
    freq_hz = np.fft.rfftfreq(samples, 1 / rate_hz)
    excited = (freq_hz > 10) & (freq_hz < 150)
    phases = np.random.default_rng(4).uniform(0, 2 * np.pi, len(freq_hz))
    floor = np.where(excited, np.exp(1j * phases), 0)
    exact = np.zeros((len(freq_hz), len(OUTPUTS)), complex)
    exact[excited] = transmissibility(folder, freq_hz[excited])[:, :, 0]
    motion = np.fft.irfft(exact.T * floor)
    np.savez(
        folder / "records.npz",
        rate_hz=rate_hz,
        force=np.tile(np.fft.irfft(floor), 3)[None],
        response=np.tile(motion, 3)[None],
    )
    campaign = read_campaign(*read_settings(folder), load_machine(folder / "model.xml").layout)
    (test,) = campaign.tests
    assert test.condition.reference == parse_port("floor:+tx")
    values = test.estimate.frf.values[:, :, 0]
    chosen = np.isin(freq_hz, test.estimate.frf.freq_hz)
    np.testing.assert_allclose(values, exact[chosen], rtol=1e-3, atol=1e-3)


def test_no_channel_reads_the_floor(tmp_path):
    folder = write(tmp_path / "c", "frf.npz", OUTPUTS[:1])
    text = (folder / "campaign.toml").read_text(encoding="utf-8")
    (folder / "campaign.toml").write_text(
        text.replace('"acc1:+tx", "acc1:+tz"', '"floor:+tx", "acc1:+tz"')
    )
    freq_hz = np.linspace(5.0, 165.0, 50)
    values = transmissibility(folder, freq_hz)[:, :, :1]
    np.savez(folder / "frf.npz", freq_hz=freq_hz, frf=values)
    with pytest.raises(InputError, match="floor"):
        open_session(folder)
