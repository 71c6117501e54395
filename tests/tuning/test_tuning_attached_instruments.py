"""Masses of accelerometers and gauges, and stingers, in the tests in which they hang there."""

import numpy as np
import pytest

from diagnosis.data_checks.check_data import release_session
from identification.words import InputError
from mbmodel import load_machine
from mbmodel.parts import Stinger
from tests.helpers.campaign_folder import write_folder
from tuning import fit, open_session, predict

STEEL = 2.1e11
WELDED = '<body pos="{pos}"><inertial pos="0 0 0" mass="0.4" diaginertia="1e-9 1e-9 1e-9"/></body>'
PLACES = {
    "acc3": "0.1 0.15 0.75",
    "acc4": "-0.2 -0.1 0.8",
    "acc5": "0.1 -0.3 0.45",
    "acc6": "0.15 -0.12 0.7",
}


@pytest.fixture
def folder(tmp_path):
    return write_folder(tmp_path / "campaign")


def with_tables(folder, text):
    file = folder / "campaign.toml"
    file.write_text(file.read_text(encoding="utf-8") + text, encoding="utf-8")
    return open_session(folder)


def answers(session):
    return np.stack(predict(session.model, session.model.drawn, session.campaign))


@pytest.mark.parametrize(
    ("table", "sites"),
    [("sensor.acc6", ["acc6"]), ("hammer.default", ["acc3", "acc4", "acc5"])],
)
def test_a_mass_on_the_machine_is_one_that_is_welded_there(folder, tmp_path, table, sites):
    file = folder / "campaign.toml"
    text = file.read_text(encoding="utf-8").replace('"3:-y", "3:+z"', '"4:-y", "5:+z"')
    file.write_text(text, encoding="utf-8")
    drawing = (folder / "model.xml").read_text(encoding="utf-8")
    for site in sites:
        weight = WELDED.format(pos=PLACES[site])
        drawing = drawing.replace(f'<site name="{site}"', f'{weight}<site name="{site}"')
    heavier = tmp_path / "heavier.xml"
    heavier.write_text(drawing, encoding="utf-8")
    welded = answers(open_session(folder, machine=load_machine(heavier)))
    stated = with_tables(folder, f"\n[{table}]\nmass = 0.4\n")
    np.testing.assert_allclose(answers(stated), welded, rtol=1e-6)
    (remark,) = (text for text in stated.campaign.remarks if "on the machine" in text)
    assert all(f"400 g at {site}" in remark for site in sites)


def clamped_beam(stinger, elements=8):
    """Stiffness of the free end of a clamped beam along x, by finite elements; (6, 6)."""
    bending = stinger.modulus * np.pi * stinger.diameter**4 / 64
    step = stinger.length / elements
    size = 6 * (elements + 1)
    whole = np.zeros((size, size))
    lateral = bending / step**3 * np.array(
        [
            [12, 6 * step, -12, 6 * step],
            [6 * step, 4 * step**2, -6 * step, 2 * step**2],
            [-12, -6 * step, 12, -6 * step],
            [6 * step, 2 * step**2, -6 * step, 4 * step**2],
        ]
    )  # fmt: skip
    twist = 2 * bending / 2.6 / step * np.array([[1, -1], [-1, 1]])
    for first in range(0, 6 * elements, 6):
        for place, rows in ((1, (1, 5, 7, 11)), (2, (2, 4, 8, 10))):
            turn = np.diag([1.0, 1.0, 1.0, 1.0] if place == 1 else [1.0, -1.0, 1.0, -1.0])
            at = np.array(rows) + first
            whole[np.ix_(at, at)] += turn @ lateral @ turn
        at = np.array([3, 9]) + first
        whole[np.ix_(at, at)] += twist
    free = whole[6:, 6:]
    inner = [k for k in range(len(free) - 6) if k % 6 != 0]  # nothing moves along the rod
    end = np.arange(len(free) - 6, len(free))
    coupling = free[np.ix_(end, inner)]
    condensed = np.linalg.solve(free[np.ix_(inner, inner)], coupling.T)
    return free[np.ix_(end, end)] - coupling @ condensed


def test_a_stinger_is_a_clamped_beam_without_its_axial_force():
    rod = Stinger(0.002, 0.05, STEEL)
    expected = clamped_beam(rod)
    np.testing.assert_allclose(
        rod.stiffness(np.array([1.0, 0.0, 0.0])), expected, rtol=1e-9, atol=1e-9 * expected.max()
    )


def test_a_stinger_that_pushes_the_other_way_bends_the_other_way():
    rod, along = Stinger(0.002, 0.05), np.array([0.0, 0.6, 0.8])
    there, back = rod.stiffness(along), rod.stiffness(-along)
    np.testing.assert_allclose(there[:3, 3:], -back[:3, 3:])
    np.testing.assert_allclose(there @ np.append(along, np.zeros(3)), 0, atol=1e-9 * there.max())
    assert np.linalg.eigvalsh(there).min() > -1e-9 * there.max()


def test_a_stinger_stiffens_its_tests_alone_and_no_tuned_stiffness(folder):
    bare = open_session(folder)
    held = with_tables(
        folder, "\n[hammer.default]\nmass = 0.05\nstinger = { diameter = 0.004, length = 0.05 }\n"
    )
    (remark,) = (text for text in held.campaign.remarks if "on the machine" in text)
    assert "50 g at acc3 with a stinger of 2.53e+05 N/m sideways and 211 N m/rad" in remark
    moved = np.abs(answers(held) - answers(bare)).max() / np.abs(answers(bare)).max()
    assert moved > 0.01
    assert held.parametrisation.names == bare.parametrisation.names
    assert all(part.acts(None) == 0 for part in held.model.parts[-3:])
    fitted = fit(held.model, held.campaign, parametrisation=held.parametrisation)
    names = [parameter.name for parameter in held.model.parameters]
    assert [fitted.theta[k] for k, name in enumerate(names) if "attached" in name] == [0.05] * 3


def test_a_diagnosis_keeps_what_hangs_on_the_machine(folder):
    stated = with_tables(folder, "\n[sensor.acc6]\nmass = 0.4\n")
    diagnosed, _ = release_session(stated)
    expected = answers(stated)
    assert np.abs(answers(diagnosed) - expected).max() < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[sensor.acc9]\nmass = 0.01\n", "acc9"),
        ("[sensor.acc1]\nmass = -0.01\n", "sensor.acc1.mass"),
        ("[sensor.acc6]\nmass = 500\n", "has a mass of 500 kg, and head itself has 35 kg"),
        ("[hammer.default]\nstinger = { diameter = 0.002 }\n", "length"),
        ("[hammer.default]\nstinger = { diameter = 1.5, length = 40 }\n", "diameter"),
    ],
)
def test_instruments_that_are_nowhere_or_incomplete_are_refused(folder, table, message):
    with pytest.raises(InputError, match=message):
        with_tables(folder, f"\n{table}")
