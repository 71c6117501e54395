"""Sources that move no error, errors that drift without limit, and poles without damping."""

import numpy as np
import pytest
from budget_case import BUDGET, write_machine

from identification.words import InputError
from mbmodel import as_drawn, load_machine
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.budget_remarks import budget_sentences
from tuning.plant.error_budget.read_definition import read_definition

ONE = """<mujoco><option gravity="0 0 0"/><worldbody><body name="m">
  <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
  <joint name="m_tx" type="slide" axis="1 0 0" stiffness="{stiffness}" damping="{damping}"/>
  <site name="acc1"/></body></worldbody></mujoco>"""
FORCE = """band = [0.5, 200.0]
[error.x]
output = "acc1:+tx"
[disturbance.f]
input = "acc1:+{direction}"
density = {density}
unit = "N/sqrt(Hz)"
"""
MASS, DENSITY = 2.0, 0.3


def budget_of(place, text, machine):
    (place / "budget.toml").write_text(text, encoding="utf-8")
    model = as_drawn(load_machine(place / machine))
    definition = read_definition(place / "budget.toml", model.machine)
    return error_budget(model, model.drawn, definition)


def one_mass(place, extra="", stiffness=0.0, damping=0.0, direction="tx"):
    machine = ONE.format(mass=MASS, stiffness=stiffness, damping=damping)
    (place / "one.xml").write_text(machine, encoding="utf-8")
    return budget_of(place, FORCE.format(density=DENSITY, direction=direction) + extra, "one.xml")


def test_a_source_that_moves_no_error_is_named(tmp_path):
    write_machine(tmp_path)
    aside = '[disturbance.aside]\ninput = "acc2:+ty"\ndensity = 1e3\nunit = "N/sqrt(Hz)"\n'
    text = BUDGET.format(gain=3e5, delay=0.0, lines=aside)
    budget = budget_of(tmp_path, text, "two.xml")
    assert budget_sentences(budget) == [
        "aside moves no error of this budget: check its point and direction, or remove it."
    ]
    assert budget_sentences(budget_of(tmp_path, text.replace("+ty", "+tx"), "two.xml")) == []


def test_a_source_that_moves_no_error_is_named_if_it_is_the_only_one(tmp_path):
    budget = one_mass(tmp_path, stiffness=1e4, damping=10.0, direction="ty")
    assert budget.rms[0] == pytest.approx(0.0, abs=1e-15)
    (sentence,) = budget_sentences(budget)
    assert sentence.startswith("f moves no error")


def test_a_free_mass_has_the_rms_of_its_band_and_a_remark(tmp_path):
    budget = one_mass(tmp_path)
    low, high = 0.5, 200.0
    # The integral of S0 / (m^2 (2 pi f)^4) over the band.
    square = DENSITY**2 / (MASS**2 * (2 * np.pi) ** 4) * (low**-3 - high**-3) / 3
    assert budget.rms[0] ** 2 == pytest.approx(square, rel=1e-3)
    assert budget_sentences(budget) == [
        "x depends on the lower end of the band, 0.5 Hz: f drives a pole of the machine at 0 Hz, "
        "so that the rms from 0 Hz upwards has no limit."
    ]


LOOP = """[loop.l]
input = "acc1:+tx"
output = "acc1:+tx"
quantity = "{quantity}"
controller = {{ {poles}gain = {gain} }}
"""


@pytest.mark.parametrize(("quantity", "is_drifting"), [("mobility", True), ("receptance", False)])
def test_a_free_mass_with_a_loop_drifts_unless_the_loop_holds_its_position(
    tmp_path, quantity, is_drifting
):
    extra = LOOP.format(quantity=quantity, poles="", gain=300.0)
    budget = one_mass(tmp_path, extra, damping=20.0)
    assert len(budget_sentences(budget)) == is_drifting
    if is_drifting:
        assert "f drives a pole of the closed loop at 0 Hz" in budget_sentences(budget)[0]


def test_a_source_that_falls_faster_than_the_pole_rises_does_not_drift(tmp_path):
    rows = "\n".join(f"{f},{1e-6 * f**4}" for f in (0.01, 300.0))
    (tmp_path / "force.csv").write_text(f"f,x [N^2/Hz]\n{rows}\n", encoding="utf-8")
    (tmp_path / "one.xml").write_text(ONE.format(mass=MASS, stiffness=0.0, damping=0.0))
    text = FORCE.format(density=1.0, direction="tx").replace("density = 1.0", 'csv = "force.csv"')
    text = text.replace('unit = "N/sqrt(Hz)"\n', "")
    assert budget_sentences(budget_of(tmp_path, text, "one.xml")) == []


def test_a_driven_pole_without_damping_is_refused(tmp_path):
    stiffness = MASS * (2 * np.pi * 20.0) ** 2
    with pytest.raises(InputError, match="the machine has a pole without damping at 20 Hz"):
        one_mass(tmp_path, stiffness=stiffness)
    # The loop's force takes away exactly the damping of the spring.
    extra = LOOP.format(quantity="mobility", poles="", gain=-7.0)
    with pytest.raises(InputError, match="the closed loop has a pole without damping at 20 Hz"):
        one_mass(tmp_path, extra, stiffness=stiffness, damping=7.0)


def test_a_pole_without_damping_that_nothing_drives_is_no_error(tmp_path):
    y = '<joint name="m_ty" type="slide" axis="0 1 0" stiffness="3e4"/><site'
    machine = ONE.format(mass=MASS, stiffness=1e4, damping=10.0)
    (tmp_path / "one.xml").write_text(machine, encoding="utf-8")
    text = FORCE.format(density=DENSITY, direction="tx")
    expected = budget_of(tmp_path, text, "one.xml").rms
    (tmp_path / "one.xml").write_text(machine.replace("<site", y), encoding="utf-8")
    assert budget_of(tmp_path, text, "one.xml").rms == pytest.approx(expected, rel=1e-3)
