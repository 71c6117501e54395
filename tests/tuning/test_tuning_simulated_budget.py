"""An error budget in time: its rms and its sources, against the budget and their definitions."""

import numpy as np
import pytest
import scipy.signal
from budget_case import BUDGET, LOOP_DELAY, write_machine

from identification.words import UsageError
from mbmodel import load_machine, parse_input
from tuning.plant.error_budget.read_definition import read_definition
from tuning.plant.error_budget.simulated_budget import (
    sampled_rate,
    simulate_budget,
    source_signals,
)

CONTINUOUS = BUDGET.format(gain=3e4, delay=LOOP_DELAY, lines="")
SAMPLED = CONTINUOUS.replace(
    "zeros = [-60.0, -8.0], poles = [-0.5, -700.0], gain = 30000.0",
    "zeros = [0.95], poles = [0.4], gain = 3e4, period = 1e-3",
)
SINES = "speed_hz = 4.0\nlines = [{ order = 2, amplitude = 1.5 }, { order = 5, amplitude = 0.7 }]"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return write_machine(tmp_path_factory.mktemp("two"))


def read_case(place, text):
    file = place / "budget.toml"
    file.write_text(text, encoding="utf-8")
    machine = load_machine(place / "two.xml")
    return machine, read_definition(file, machine)


@pytest.mark.parametrize(
    "text",
    [
        CONTINUOUS,
        SAMPLED,
        BUDGET.format(gain=3e4, delay=LOOP_DELAY, lines=SINES),
        CONTINUOUS.partition("[noise.encoder]")[0],  # no loop at all
    ],
)
def test_the_rms_in_time_is_that_of_the_budget(place, text):
    machine, definition = read_case(place, text)
    rate = sampled_rate(definition, 400.0)
    time_s = np.arange(round(12 * rate) + 1) / rate
    simulated = simulate_budget(machine, definition, time_s, {})
    distance = (simulated.rms / simulated.predicted - 1) / simulated.scatter
    assert simulated.response.step.error < 3e-3
    assert (simulated.scatter < 0.15).all()
    assert (np.abs(distance) < 3.5).all()


def test_the_scatter_of_a_simulated_rms_is_what_is_stated(place):
    # Twelve seeds: the standardised distances have a mean and a variance within chance.
    machine, definition = read_case(place, CONTINUOUS.partition("[noise.encoder]")[0])
    rate = sampled_rate(definition, 400.0)
    time_s = np.arange(round(6 * rate) + 1) / rate
    runs = [simulate_budget(machine, definition, time_s, {}, seed=seed) for seed in range(12)]
    distance = np.array([(run.rms / run.predicted - 1) / run.scatter for run in runs])[:, 0]
    assert abs(distance.mean()) < 3.5 / np.sqrt(12)
    assert 0.3 < distance.std() < 2.0


def test_sources_have_the_density_and_the_coherence_of_the_file(place):
    machine, definition = read_case(place, CONTINUOUS)
    rate = 512.0
    time_s = np.arange(round(400 * rate)) / rate
    signals = source_signals(machine, definition, time_s, 1.0, seed=3)
    floor, drive = (signals[parse_input(machine, text)] for text in ("floor:+tx", "drive"))
    freq, cross = scipy.signal.csd(drive, floor, rate, nperseg=2048)
    inside = (freq > 4) & (freq < 40)
    powers = [scipy.signal.welch(each, rate, nperseg=2048)[1] for each in (floor, drive)]
    for power, source in zip(powers, definition.sources, strict=False):
        expected = source.spectrum.at(freq[inside], source.derivative)
        assert np.mean(power[inside] / expected) == pytest.approx(1.0, abs=0.02)
    coherence = cross[inside] / np.sqrt(powers[0][inside] * powers[1][inside])
    # csd conjugates its first signal: the floor leads by 40 degrees, as the file states.
    assert np.angle(coherence.mean(), deg=True) == pytest.approx(40.0, abs=3.0)
    assert np.abs(coherence.mean()) ** 2 == pytest.approx(0.6, abs=0.04)


def test_the_floor_rises_smoothly_and_does_not_drift(place):
    machine, definition = read_case(place, CONTINUOUS)
    time_s = np.arange(0, 40, 1 / 512)
    floor = source_signals(machine, definition, time_s, 3.0, seed=1)[
        parse_input(machine, "floor:+tx")
    ]
    velocity = np.cumsum(floor) / 512
    moved = np.cumsum(velocity) / 512
    assert abs(floor[0]) < 1e-12
    late = moved[len(moved) // 2 :]
    assert abs(late.mean()) < 0.1 * late.std()


def test_samples_that_do_not_hold_the_sources_are_refused(place):
    machine, definition = read_case(place, CONTINUOUS)
    with pytest.raises(UsageError, match="reach to 45 Hz, which samples at 100 Hz do not hold"):
        simulate_budget(machine, definition, np.arange(0, 2, 0.01), {})
