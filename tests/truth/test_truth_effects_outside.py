"""Effects that the catalogue lacks, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from effect_rigs import FREQ, OCCASIONS, chain, frf_of, random_of, rig_of, scene_of

from truth.effects import CATALOGUE
from truth.effects.feedback_delay import poles
from truth.effects.outside import (
    OUTSIDE,
    ChangingStiffness,
    Crosstalk,
    FractionalDamper,
    draw_crosstalk,
    draw_fractional_damper,
)
from truth.effects.places import StageDirection
from truth.errors import TruthError
from truth.machine.rig import Occasion

W = 2 * np.pi * FREQ
S = 1j * W
TZ = StageDirection("table", 2, "tz")
MINE = ("fractional_damper", "changing_stiffness", "crosstalk")


def vertical(one_body, effect, time=0.0):
    occasions = tuple(replace(one, node=3, time=time) for one in OCCASIONS)
    return frf_of(one_body, effect, occasions=occasions)[:, 2, 2]


@pytest.mark.parametrize("name", MINE)
def test_nobody_expects_them(name):
    assert name not in CATALOGUE
    effect = OUTSIDE[name](random_of(4), scene_of(chain()), "joint:arm")
    assert effect.kind == name
    answer = effect.answer()
    assert (answer.effect, answer.location) == ("unexplained", "joint:arm")


def test_a_fractional_damper_is_between_spring_and_dashpot(one_body):
    effect = FractionalDamper(TZ, 7e6, 0.4, size=0.3)
    joint = one_body.stages[0].joints[2]
    law = 0.3 * 7e6 * (FREQ / 50) ** 0.4 * np.exp(0.4j * np.pi / 2)
    expected = S**2 / (120 * S**2 + joint.damping * S + joint.stiffness + law)
    np.testing.assert_allclose(vertical(one_body, effect), expected, rtol=1e-10)
    values = effect.answer().parameters
    assert values["order"] == 0.4
    assert values["coefficient"] * (2 * np.pi * 50) ** 0.4 == pytest.approx(0.3 * 7e6)


def test_orders_are_between_a_third_and_two_thirds():
    drawn = [draw_fractional_damper(random_of(s), scene_of(chain()), None) for s in range(60)]
    assert all(0.3 <= one.order <= 0.7 for one in drawn)
    with pytest.raises(TruthError, match="make no sense"):
        FractionalDamper(TZ, 7e6, 1.0, size=0.3)


@pytest.mark.parametrize(("sign", "end"), [(1, 1.5), (-1, 1 / 1.5)])
def test_a_changing_stiffness_runs_from_one_to_its_factor(one_body, sign, end):
    effect = ChangingStiffness(TZ, sign, size=float(np.log(1.5)))
    joint = one_body.stages[0].joints[2]
    for time, factor in ((0.0, 1.0), (0.5, end**0.5), (1.0, end)):
        expected = S**2 / (120 * S**2 + joint.damping * S + factor * joint.stiffness)
        np.testing.assert_allclose(vertical(one_body, effect, time), expected, rtol=1e-9)
    assert effect.answer().parameters == {"factor": pytest.approx(end)}


@pytest.mark.parametrize("hits", [2, 5, 10, 15, 31])
def test_at_most_five_machines_arise_from_the_hits_of_a_column(hits):
    effect = ChangingStiffness(TZ, 1, size=0.3)
    times = [effect.when(Occasion(time=float(time))) for time in np.linspace(0, 1, hits)]
    assert len(set(times)) == min(hits, 5)
    assert times == sorted(times)
    assert (times[0], times[-1]) == (0.0, 1.0)


def crosstalk(coupling: float = 300.0) -> Crosstalk:
    return Crosstalk(
        StageDirection("holder", 0, "tx"),
        StageDirection("table", 1, "ty"),
        coupling,
        largest=2.0,
        size=0.5,
    )


def test_crosstalk_pushes_one_joint_by_the_speed_of_another(two_bodies):
    # As the table moves along +y with 1 m/s, the holder is pushed along -x, the table along +x.
    rig, plain = rig_of(two_bodies, [crosstalk()]), rig_of(two_bodies)
    force = -(rig.equations.damping - plain.equations.damping) @ np.eye(12)[1]
    assert force[6] == pytest.approx(-150.0)
    assert force[0] == pytest.approx(150.0)
    assert np.abs(force[[1, 2, 7, 8]]).max() < 1e-9
    np.testing.assert_array_equal(rig.equations.stiffness, plain.equations.stiffness)
    assert crosstalk().answer().parameters == {"coupling": 150.0}
    assert crosstalk().answer().dof == "tx"


def test_crosstalk_goes_both_ways_between_stages_and_leaves_the_machine_stable(nominal):
    scene = scene_of(nominal, 11)
    drawn = [draw_crosstalk(random_of(s), scene, None) for s in range(24)]
    assert {np.sign(one.coupling) for one in drawn} == {1.0, -1.0}
    unstable = 0
    for one in drawn:
        assert one.source.stage != one.direction.stage
        assert 0.2 <= one.size / one.largest <= 0.7
        low, high = one.limits
        assert low == pytest.approx(1e-4 * high)
        assert one.size < high == one.largest <= 20
        assert one.largest >= min(1.6, 20)
        assert poles(rig_of(nominal, [one.sized(one.largest)], node=11)).real.max() < 0
        beyond = poles(rig_of(nominal, [one.sized(one.largest / 0.79)], node=11)).real.max()
        assert beyond > 0 or one.largest == 20
        unstable += beyond > 0
    assert unstable > 3
