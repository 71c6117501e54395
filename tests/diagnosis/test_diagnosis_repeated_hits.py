"""A further hit that measures the same again is no experiment."""

import numpy as np
import pytest

from diagnosis.next_test.discriminating import _repeats_measured_hits
from diagnosis.next_test.experiments import Experiment, RivalModel
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine

FREQ_HZ = np.linspace(2.0, 60.0, 80)
MODEL = """<mujoco model="slider"><option gravity="0 0 0"/><worldbody>
<body name="low"><inertial mass="20" pos="0 0 0" diaginertia="1 1 1"/>
<joint name="low_tx" type="slide" axis="1 0 0" stiffness="4e5" damping="100"/>{tilt}
<site name="acc1" pos="0.1 0 0.2"/><site name="hit1" pos="-0.1 0 0"/>
<body name="top"><inertial mass="8" pos="0 0 0.4" diaginertia="1 1 1"/>
<joint name="top_tx" type="slide" axis="1 0 0" stiffness="2e5" damping="60"/>
<site name="acc2" pos="0.1 0 0.4"/></body></body></worldbody></mujoco>"""
TILT = '<joint name="low_ry" type="hinge" axis="0 1 0" stiffness="3e4" damping="5"/>'


def repeats(path, tilt, hit):
    path.write_text(MODEL.format(tilt=tilt), encoding="utf-8")
    machine = load_machine(path)
    model = as_drawn(machine)
    outputs, reference = (Dof.parse("acc1:+tx"), Dof.parse("acc2:+tx")), Dof.parse("hit1:+tx")
    values = Evaluator(model, FrfRequest(FREQ_HZ, outputs, (reference,))).at(model.drawn).values
    variance = np.full(values.shape, 1e-6 * (np.abs(values) ** 2).mean())
    frf = Frf(FREQ_HZ, values, outputs, (reference,), "accelerance")
    estimate = FrfEstimate(frf, variance, "coherence", np.ones((2, 1), bool))
    campaign = Campaign("t", machine.layout, (Test(Condition("t.npz", reference), estimate),))
    noise = {dof: variance[:, row, 0] for row, dof in enumerate(outputs)}
    rival = RivalModel(model, model.drawn, None, frozenset(), 0.0)
    experiment = Experiment("hit", (Dof.parse(hit),), is_further_hit=True)
    return _repeats_measured_hits(rival, campaign, noise, experiment)


@pytest.mark.parametrize(
    ("tilt", "hit", "is_repeated"),
    [
        ("", "acc1:+tx", True),  # the body slides: all its points move alike
        ("", "acc1:+tz", True),  # nothing moves
        ("", "acc2:+tx", False),  # another body
        (TILT, "acc1:+tx", False),  # the body tilts: the height of the hit counts
    ],
)
def test_a_hit_on_a_body_that_only_slides_is_repeated_by_another(tmp_path, tilt, hit, is_repeated):
    assert repeats(tmp_path / "m.xml", tilt, hit) is is_repeated
