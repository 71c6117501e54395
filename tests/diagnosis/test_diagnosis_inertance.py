"""Mass that acts across a joint: its physics, what is written of it, and that it is named."""

import tomllib

import mujoco
import numpy as np
import pytest

from diagnosis import EFFECTS, Scene, build_verdict, diagnose
from identification.words import Dof
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    RigidDirection,
    load_machine,
    spring_parts,
    write_model,
)
from tests.helpers.drawn import drawn

TWO_MASSES = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="low">
      <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
      <joint name="low_tx" type="slide" axis="1 0 0" stiffness="40000" damping="20"/>
      <site name="acc1"/>
      <body name="high" pos="0 0 1">
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
        <joint name="high_tx" type="slide" axis="1 0 0" stiffness="9000" damping="7" armature="0.25"/>
        <site name="acc2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""  # noqa: E501
FREQ = np.linspace(1.0, 60.0, 30)


class Drawn:
    """As much of a scene as the effect reads."""

    rigid_directions = ()

    def __init__(self, model):
        self.model = model


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "two.xml"
    path.write_text(TWO_MASSES)
    machine = load_machine(path)
    return Model(machine, tuple(spring_parts(machine)))


def with_inertance(model, kilograms):
    """The model with an inertance between both masses, and theta."""
    hypothesis = next(h for h in EFFECTS["inertance"](Drawn(model)) if h.location == "joint:high")
    (name,) = hypothesis.coordinates
    size = kilograms / hypothesis.state({name: 1.0})["inertance"]
    whole = Model(model.machine, (*model.parts, *hypothesis.parts))
    return whole, np.append(model.drawn, size), hypothesis


def test_two_masses_with_an_inerter_answer_as_the_closed_form(model):
    b = 1.5
    whole, theta, hypothesis = with_inertance(model, b)
    assert (hypothesis.dof, hypothesis.signed) == ("tx", True)
    ports = (Dof("acc1", "+tx"), Dof("acc2", "+tx"))
    frf = Evaluator(whole, FrfRequest(FREQ, ports, ports, "receptance"), direct=True)
    s = 2j * np.pi * FREQ
    across = (b + 0.25) * s**2 + 7 * s + 9000  # the drawn armature stays
    stiffness = np.empty((len(s), 2, 2), complex)
    stiffness[:, 0, 0] = 3 * s**2 + 20 * s + 40000 + across
    stiffness[:, 1, 1] = 2 * s**2 + across
    stiffness[:, 0, 1] = stiffness[:, 1, 0] = -across
    np.testing.assert_allclose(frf.at(theta).values, np.linalg.inv(stiffness), rtol=1e-9)


def test_the_written_armature_is_the_mass_matrix_that_mujoco_compiles(model, tmp_path):
    whole, theta, _ = with_inertance(model, 1.5)
    target = tmp_path / "written.xml"
    written = write_model(whole, theta, target)
    assert not written.not_held
    assert not written.difference
    compiled = mujoco.MjModel.from_xml_path(str(target))
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    mass = np.zeros((2, 2))
    mujoco.mj_fullM(compiled, data, mass)
    np.testing.assert_allclose(mass, [[5.0, 2.0], [2.0, 2.0 + 0.25 + 1.5]], rtol=1e-12)


def test_an_inertance_is_named_with_its_size(tmp_path):
    session, text = drawn(
        tmp_path, 72_044, "inertance", ratio=6.0, place="joint:stage2", lines=161, stages=2
    )
    answer = tomllib.loads(text)
    verdict = build_verdict(diagnose(session))
    (cause,) = (cause for cause in verdict.causes if cause.probability >= 0.5)
    place = answer["location"], answer["dof"]
    assert (cause.effect, cause.location, cause.dof) == ("inertance", *place)
    true = answer["parameters"]["inertance"]
    assert cause.parameters["inertance"] == pytest.approx(true, rel=0.1)
    low, high = cause.interval["inertance"]
    assert low <= true <= high
    assert low > 0


def test_an_inertance_is_proposed_for_each_direction_that_is_not_rigid(tmp_path):
    session, _ = drawn(tmp_path, 72_001, lines=41, stages=2)
    axles = session.model.machine.axles
    last = axles[-1]
    rigid = RigidDirection(last.stage, last.dof, last.coordinate, 1e8, 9e12, 1e-4)
    proposed = [h.key for h in EFFECTS["inertance"](Scene(session, session.model.drawn, (rigid,)))]
    assert proposed == [("inertance", f"joint:{axle.stage}", axle.dof) for axle in axles[:-1]]


def test_along_the_only_direction_of_a_body_on_the_ground_an_inertance_is_a_mass(model):
    proposed = [h.location for h in EFFECTS["inertance"](Drawn(model))]
    assert proposed == ["joint:high"]
