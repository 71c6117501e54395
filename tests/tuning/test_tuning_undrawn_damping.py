"""Damping that a drawing leaves out: fitted, never negative, known to be some per cent."""

import numpy as np
import pytest

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test, Tolerance
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from tuning import estimate_confidence, fit, parametrise

FREQ = np.linspace(5.0, 90.0, 400)
DAMPING = (60.0, 20.0)  # [N s/m], 2.5 and 1.2 % of critical
LOWER = ("base_tx.damping", "top_tx.damping")


def stack(path, damping=("", "")):
    """Two masses of 8 and 4 kg in series on springs of 3e5 and 2e5 N/m."""
    lower, upper = (f'damping="{value}"' if value else "" for value in damping)
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="base">'
        '<inertial pos="0 0 0" mass="8" diaginertia="1 1 1"/>'
        f'<joint name="base_tx" type="slide" axis="1 0 0" stiffness="3e5" {lower}/>'
        '<site name="acc1"/><body name="top"><inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/>'
        f'<joint name="top_tx" type="slide" axis="1 0 0" stiffness="2e5" {upper}/>'
        '<site name="acc2"/></body></body></worldbody></mujoco>',
        encoding="utf-8",
    )
    return as_drawn(load_machine(path))


@pytest.fixture(scope="module")
def undrawn(tmp_path_factory):
    return stack(tmp_path_factory.mktemp("undrawn") / "undrawn.xml")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory, undrawn):
    """One test of the damped machine at both masses, with 1 % noise."""
    machine = stack(tmp_path_factory.mktemp("damped") / "damped.xml", DAMPING)
    dofs, reference = (Dof.parse("acc1:+tx"), Dof.parse("acc2:+tx")), Dof.parse("acc1:+tx")
    values = Evaluator(machine, FrfRequest(FREQ, dofs, (reference,))).at(machine.drawn).values
    random = np.random.default_rng(4)
    sigma = np.broadcast_to(0.01 * np.sqrt((np.abs(values) ** 2).mean(axis=0)), values.shape)
    noise = (random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)).astype(float)
    frf = Frf(FREQ, values + noise[0] + 1j * noise[1], dofs, (reference,), "accelerance")
    estimate = FrfEstimate(frf, sigma**2, "differences", np.ones(values.shape[1:], bool))
    tests = (Test(Condition("t", reference), estimate),)
    return Campaign("two masses", undrawn.machine.layout, tests)


def test_its_unit_is_a_hundredth_of_critical_damping(undrawn):
    usual = {p.name: p.usual for p in undrawn.parameters if p.known == "undrawn_damping"}
    # The elongation of the lower spring moves the base alone, that of the upper one both masses
    # against each other, 8 x 4 / 12 kg.
    assert usual == {
        "base_tx.damping": pytest.approx(0.02 * np.sqrt(3e5 * 8.0)),
        "top_tx.damping": pytest.approx(0.02 * np.sqrt(2e5 * 8 * 4 / 12)),
    }


def test_it_is_found_from_a_drawing_without_any(undrawn, campaign):
    result = fit(undrawn, campaign)
    confidence = estimate_confidence(undrawn, campaign, result)
    values = dict(zip((p.name for p in undrawn.parameters), result.theta, strict=True))
    assert [values[name] for name in LOWER] == pytest.approx(DAMPING, rel=0.1)
    varies = result.parametrisation
    deviations = np.sqrt(np.diag(confidence.covariance)) * varies.scales
    for name, truth in zip(LOWER, DAMPING, strict=True):
        assert abs(values[name] - truth) < 4 * deviations[varies.names.index(name)]


def test_it_varies_from_zero_upwards_unless_it_is_known(undrawn):
    varies = parametrise(undrawn, Tolerance())
    place = varies.names.index(LOWER[0])
    assert (varies.lower[place], varies.upper[place], varies.precision[place]) == (0, np.inf, 1)
    assert np.array_equal(varies.fixed, undrawn.drawn)
    start = varies.coordinates(varies.start)
    assert start[place] == 1.0
    assert np.count_nonzero(start) == 2
    assert not varies.has_user_bounds[place]
    known = parametrise(undrawn, Tolerance(damping=1.0))
    assert not set(LOWER) & set(known.names)


def test_a_free_direction_has_none(tmp_path):
    machine = stack(tmp_path / "free.xml").machine
    text = (tmp_path / "free.xml").read_text(encoding="utf-8").replace('stiffness="2e5"', "")
    (tmp_path / "free.xml").write_text(text, encoding="utf-8")
    free = as_drawn(load_machine(tmp_path / "free.xml"))
    assert machine.springs[1].stiffness > 0
    assert [p.name for p in free.parameters] == ["base_tx.stiffness", "base_tx.damping"]
