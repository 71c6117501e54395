"""A roving hammer and three fixed accelerometers, without a model: universal files, end to end."""

import json
from dataclasses import replace

import numpy as np
import pytest
from identification_examples import Function, dataset, units
from typer.testing import CliRunner

from mbw.command import app

NODES, SENSORS, AVERAGES = tuple(range(1, 10)), (3, 6, 9), 5
FREQ = np.array([22.0, 47.0, 95.0, 125.2, 125.6, 163.0])
DAMPING = np.array([0.006, 0.003, 0.008, 0.002, 0.003, 0.005])
AXIS = np.arange(0, 801) * 0.25
MISSING = (8, 6)
CAMPAIGN = f"""\
layout = "geometry.unv"

[[test]]
file = "roving.uff"
averages = {AVERAGES}
"""


def functions():
    """FRF and coherence of every hit and sensor; one cell is missing, two are there twice."""
    rng = np.random.default_rng(84)  # six shapes that differ much
    shapes = rng.normal(size=(len(NODES), len(FREQ)))
    s = 2j * np.pi * AXIS
    poles = 2 * np.pi * FREQ * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    for sensor in SENSORS:
        for hit in NODES:
            if (hit, sensor) == MISSING:
                continue
            residues = shapes[hit - 1] * shapes[sensor - 1] / (2j * poles.imag)
            values = (residues / (s[:, None] - poles)).sum(1)
            values = (values + (residues.conj() / (s[:, None] - poles.conj())).sum(1)) * s**2
            sd = 0.01 * np.sqrt((np.abs(values) ** 2).mean())
            error = rng.normal(size=(2, len(s))) / np.sqrt(2) * sd
            measured = values + error[0] + 1j * error[1]
            ratio = (AVERAGES - 1) * sd**2 / np.maximum(np.abs(measured) ** 2, 1e-300)
            frf = Function(measured, AXIS, rsp=(sensor, 3), ref=(hit, -3))
            yield replace(frf, data=-measured)  # the hammer hit downwards
            yield replace(frf, func=6, data=1 / (1 + ratio))
            if (hit, sensor) == (5, 3):
                yield replace(frf, data=-measured)
                yield replace(frf, func=6, data=1 / (1 + ratio))
            if (hit, sensor) == (9, 9):
                yield replace(frf, data=-1.5 * measured)
                yield replace(frf, func=6, data=0.5 / (1 + ratio))


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    folder = tmp_path_factory.mktemp("roving")
    (folder / "campaign.toml").write_text(CAMPAIGN)
    content = b"".join(function.content() for function in functions())
    (folder / "roving.uff").write_bytes(units(1.0, 1.0) + content)
    lines = []
    for node in NODES:
        place = (0.1 * node, 0.05 * (node % 4), 0.0)
        lines.append(f"{node:10d}{0:10d}{0:10d}{11:10d}")
        lines.append("".join(f"{v:25.16E}" for v in place).replace("E", "D"))
    (folder / "geometry.unv").write_bytes(units(1.0, 1.0) + dataset("  2411", lines))
    arguments = ["identify", str(folder), "--out", str(folder / "out")]
    ran = CliRunner().invoke(app, [*arguments, "--json", str(folder / "modes.json")])
    assert ran.exit_code == 0, ran.stderr
    return ran, json.loads((folder / "modes.json").read_text())


def test_all_modes_are_found_with_the_pair_apart_and_none_beside(outcome) -> None:
    _, found = outcome
    np.testing.assert_allclose([row["frequency"] for row in found["modes"]], FREQ, rtol=1e-3)
    np.testing.assert_allclose([row["damping"] for row in found["modes"]], DAMPING, rtol=0.1)


def test_the_points_that_were_hit_stand_as_outputs(outcome) -> None:
    _, found = outcome
    assert found["roved"]
    assert found["outputs"] == [f"acc{node}:+tz" for node in NODES]
    assert found["inputs"] == [f"acc{node}:+tz" for node in SENSORS]


def test_records_that_are_there_twice_are_named(outcome) -> None:
    ran, found = outcome
    remarks = [text for text in found["remarks"] if "the band is" not in text]
    same, unlike = sorted(remarks, key=lambda text: "differ" in text)
    assert "are identical" in same
    assert "5:-tz" in same
    assert "differ" in unlike
    assert "9:-tz" in unlike
    assert "hold one response and reference" in ran.stderr


def test_a_structure_that_bends_is_not_called_solid(outcome) -> None:
    ran, found = outcome
    (check,) = found["solid"]
    assert check["spare"] == len(NODES) - 3  # heave and two turns
    assert check["solid_to"] is None or check["solid_to"] < FREQ[0]
    assert "flexible" in check["words"]
    assert check["words"] in ran.stderr


def test_bending_in_six_shapes_proves_no_gross_fault_of_a_sensor(outcome) -> None:
    _, found = outcome
    (check,) = found["solid"]
    # Which small faults imitate the second shape depends on rounding; none is gross.
    effects = {fault["effect"] for fault in check["faults"]}
    assert effects <= {"flexible_body", "mount_resonance"}
    assert check["solid_to"] is None or check["solid_to"] < found["band"][1]
