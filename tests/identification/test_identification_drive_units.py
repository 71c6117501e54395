"""Units of what drives a test: signals in volts or counts are not printed as forces."""

from pathlib import Path

import numpy as np
import pytest

from identification.level_check import LevelCheck
from identification.level_check.trends import ModeTrend
from identification.readers.frf_units import parse_frf_units
from identification.words import Condition, Dof, Signal

FORCE, TORQUE, MOTOR = Dof.parse("acc1:+tx"), Dof.parse("acc1:+rz"), Signal("drive")


@pytest.mark.parametrize(
    ("unit", "reference", "drive"),
    [
        (None, FORCE, "N"),
        ("g/lbf", FORCE, "N"),  # converted
        (None, TORQUE, "N m"),
        ("m/s^2/V", FORCE, "V"),
        ("m/s^2/V", MOTOR, "V"),
        ("m/s^2/count", FORCE, "count"),
        ("m/s^2/N, m/s^2/A", FORCE, "N"),
        ("m/s^2/N, m/s^2/A", MOTOR, "A"),
        ("m/s^2/N", MOTOR, ""),  # its control, whose unit nobody stated
    ],
)
def test_the_unit_of_what_drives_is_that_of_the_file(unit, reference, drive):
    assert parse_frf_units(Path("t.npz"), "accelerance", unit).drive_unit(reference) == drive


def test_a_level_is_stated_in_the_unit_of_the_drive():
    assert Condition("t.npz", FORCE, 200.0).level_text == "200 N"
    assert Condition("t.npz", MOTOR, 0.1, drive_unit="V").level_text == "0.1 V"
    assert Condition("t.npz", MOTOR, 0.1, drive_unit="").level_text == "0.1"
    assert Condition("t.npz", FORCE).level_text == ""


def test_the_level_check_of_a_drive_in_volts_names_volts():
    levels, deviation = np.array([0.1, 0.3]), np.full(2, 1e-3)
    trend = ModeTrend(levels, np.array([80.0, 79.0]), deviation, np.full(2, 0.01), deviation)
    check = LevelCheck(levels, (trend,), ((True, False),), returns=True, unit="V")
    assert "0.1 to 0.3 V" in check.sentence
    assert " N:" not in check.sentence
