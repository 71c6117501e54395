"""Faults of sensors beside the bending of their body, and bending that imitates such faults."""

import numpy as np
import pytest
from solid_bodies import Case, draw

from diagnosis.data_checks import bending_bodies
from diagnosis.data_checks.bending_bodies import find_constant_errors, list_probable
from diagnosis.data_checks.sensors import check_sensors
from diagnosis.inference.evidence import BENDS
from diagnosis.settings import SETTINGS
from identification import Fault, check_bodies

SEED = 3


def bent(seed, gain=1.0):
    def read(_, values):
        return values * np.where(np.arange(values.shape[1]) == 1, gain, 1.0)[:, None]

    return draw(Case(seed, flex=(185.0, 0.6), read=read, lines=300))


@pytest.fixture(scope="module")
def checked():
    """A campaign with a gain beside bending, and its check."""
    campaign = bent(SEED, 1.8)
    return campaign, *check_bodies(campaign)


def test_a_gain_beside_bending_is_proven():
    faults = check_sensors(bent(SEED, 1.8), SETTINGS).small
    assert BENDS in {fault.effect for fault in faults}
    (gain,) = (fault for fault in faults if fault.effect == "sensor_gain")
    assert (gain.location, gain.dof) == ("sensor:p0_0", "ty")
    assert gain.parameters["gain"] == pytest.approx(1.8, rel=0.1)


def test_bending_alone_proves_no_fault_of_a_sensor():
    assert {fault.effect for fault in check_sensors(bent(SEED), SETTINGS).small} == {BENDS}


def test_a_fault_that_low_lines_do_not_show_is_not_constant(checked):
    campaign, check = checked
    (true,) = (f for f in list_probable(check, SETTINGS) if f.effect == "sensor_gain")
    larger = Fault(true.effect, true.location, true.dof, 1.0, {"gain": 3.0}, 1.0)
    elsewhere = Fault(true.effect, "sensor:p0_2", "tx", 1.0, {"gain": 1.8}, 1.0)
    mount = Fault("mount_resonance", true.location, true.dof, 1.0, {"frequency": 500.0}, 1.0)
    faults = [true, larger, elsewhere, mount]
    assert find_constant_errors(campaign, check, faults, SETTINGS) == [true]


def test_low_lines_may_show_faults_of_several_parameters(checked, monkeypatch):
    campaign, check = checked
    (true,) = (f for f in list_probable(check, SETTINGS) if f.effect == "sensor_gain")
    sizes = {"frequency": 500.0, "damping": 0.02}
    mount = Fault("mount_resonance", "sensor:p0_2", "tx", 1.0, sizes, 1.0)
    monkeypatch.setattr(bending_bodies, "list_probable", lambda *_: [true, mount])
    assert find_constant_errors(campaign, check, [true], SETTINGS) == [true]
