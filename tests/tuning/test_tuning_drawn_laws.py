"""Loss factors and Maxwell branches that campaign.toml states as drawn: ``[spring.NAME]``."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene, build_verdict, diagnose
from identification.words import Dof, InputError
from mbmodel import (
    Evaluator,
    FrfRequest,
    StatedLaws,
    as_drawn,
    load_machine,
    machine_model,
    with_spring_laws,
    write_model,
)
from tests.helpers.drawn import drawn, line_by_line
from tuning import open_session, predict

STATED = """
[spring.stage2]
loss_factor = 0.08
maxwell = [{ ratio = 0.7, tau = 0.0045 }, { ratio = 0.2, tau = 0.045 }]
"""
ONE_MASS = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="block">
      <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
      <joint name="block_tx" type="slide" axis="1 0 0" stiffness="40000" damping="20"/>
      <site name="acc1"/>
    </body>
    <body name="other" pos="0 0 1">
      <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
      <joint name="other_tx" type="slide" axis="1 0 0" stiffness="40000" damping="20"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="link" stiffness="3000">
      <joint joint="block_tx" coef="1"/><joint joint="other_tx" coef="-1"/>
    </fixed>
  </tendon>
</mujoco>
"""
FREQ = np.linspace(1.0, 60.0, 30)
S = 2j * np.pi * FREQ
LAW = 0.05j + 0.7 * 0.045 * S / (1 + 0.045 * S)
LAWS = StatedLaws(0.05, ((0.7, 0.045),))


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "one.xml"
    path.write_text(ONE_MASS)
    return load_machine(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A campaign that states laws of a joint."""
    folder = tmp_path_factory.mktemp("laws")
    drawn(folder, 72_001, lines=161, stages=2)
    with (folder / "campaign" / "campaign.toml").open("a") as settings:
        settings.write(STATED)
    return folder / "campaign"


def receptance(model, theta):
    port = (Dof("acc1", "+tx"),)
    request = FrfRequest(FREQ, port, port, "receptance")
    return Evaluator(model, request, direct=True).at(theta).values[:, 0, 0]


def block(k, link, k_other=40000.0):
    """Receptance of the block that a link holds to the other one."""
    other = 2 * S**2 + 20 * S + k_other
    return 1 / (3 * S**2 + 20 * S + k + 1 / (1 / link + 1 / other))


@pytest.mark.parametrize("name", ["block", "block_tx", "joint:block"])
def test_a_law_scales_with_the_stiffness_of_its_joint(machine, name):
    model = as_drawn(with_spring_laws(machine, {name: LAWS}, "here"))
    names = [parameter.name for parameter in model.parameters]
    for stiffness in (40000.0, 55000.0):
        theta = model.drawn.copy()
        theta[names.index("block_tx.stiffness")] = stiffness
        expected = block(stiffness * (1 + LAW), 3000.0)
        np.testing.assert_allclose(receptance(model, theta), expected, rtol=1e-9)


def test_a_tendon_has_a_law_too(machine):
    model = as_drawn(with_spring_laws(machine, {"link": LAWS}, "here"))
    expected = block(40000.0, 3000.0 * (1 + LAW))
    np.testing.assert_allclose(receptance(model, model.drawn), expected, rtol=1e-9)


def test_slopes_by_the_stiffness_are_those_of_differences(machine):
    model = as_drawn(with_spring_laws(machine, {"block": LAWS, "link": LAWS}, "here"))
    port = (Dof("acc1", "+tx"),)
    request = FrfRequest(FREQ, port, port, "receptance")
    lines = Evaluator(model, request).at(model.drawn)
    cost = np.exp(1j * FREQ)[:, None, None]  # any weights
    exact = lines.gradient(cost)
    for k, parameter in enumerate(model.parameters):
        size = parameter.drawn or parameter.usual
        step = 1e-4 * size * (np.arange(len(model.drawn)) == k)
        ends = [receptance(model, model.drawn + sign * step) for sign in (1, -1)]
        quotient = np.sum((cost[:, 0, 0].conj() * (ends[0] - ends[1])).real) / (2 * step[k])
        assert exact[k] == pytest.approx(quotient, rel=1e-5)


def test_a_written_model_keeps_its_laws_as_texts(machine, tmp_path):
    model = machine_model(with_spring_laws(machine, {"block": LAWS, "link": LAWS}, "here"))
    names = [parameter.name for parameter in model.parameters]
    theta = model.drawn.copy()
    theta[names.index("block_tx.stiffness")] = 47000.0
    written = write_model(model, theta, tmp_path / "tuned.xml")
    assert (written.not_held, written.difference) == ((), "")
    read = load_machine(tmp_path / "tuned.xml")
    assert any("block_tx" in remark and "MuJoCo itself" in remark for remark in read.remarks)
    again = as_drawn(read)
    np.testing.assert_allclose(receptance(again, again.drawn), receptance(model, theta), rtol=1e-9)
    text = (tmp_path / "tuned.xml").read_text()
    assert 'name="spring:link" data="loss_factor=0.05 maxwell=0.7@0.045"' in text
    (tmp_path / "bad.xml").write_text(text.replace("loss_factor=0.05", "loss=1"))
    with pytest.raises(InputError, match=r"the text spring:block_tx is 'loss=1 maxwell"):
        load_machine(tmp_path / "bad.xml")
    # Written once more, or stated as well in a campaign, the laws are there once.
    restated = with_spring_laws(read, {"block": LAWS}, "here")
    assert restated.springs[0].laws == read.springs[0].laws
    second = write_model(as_drawn(restated), again.drawn, tmp_path / "second.xml")
    assert second.difference == ""
    with pytest.raises(InputError, match=r"tuned\.xml states other laws of block_tx"):
        with_spring_laws(read, {"block": StatedLaws(0.1)}, "here")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[spring.stage3]\nloss_factor = 0.1\n", r"spring\.stage3: .* did you mean stage[12]\?"),
        ("[spring.stage1_tx]\nloss_factor = -0.1\n", r"spring\.stage1_tx\.loss_factor = -0\.1"),
        ("[spring.stage1]\nloss = 0.1\n", r"unknown key spring\.stage1\.loss"),
        (
            "[spring.stage1]\nmaxwell = [{ ratio = -1.0, tau = 0.1 }]\n",
            r"spring\.stage1\.maxwell\.1\.ratio = -1\.0",
        ),
        ("[spring.stage1]\nmaxwell = [{ ratio = 1.0 }]\n", r"maxwell\.1\.tau is missing"),
        (
            "[spring.stage2_tx]\nloss_factor = 0.1\n",
            r"spring\.stage2 and spring\.stage2_tx both state the laws of stage2_tx",
        ),
    ],
)
def test_what_no_spring_can_have_is_refused_in_a_sentence(folder, text, words):
    wrong = folder / "wrong.toml"
    wrong.write_text((folder / "campaign.toml").read_text() + text)
    with pytest.raises(InputError, match=words) as error:
        open_session(wrong)
    assert "\n" not in str(error.value)


def measured(session, theta, random):
    """The session with the campaign as it would be measured at theta, with noise."""
    tests = []
    values = predict(session.model, theta, session.campaign)
    for test, exact in zip(session.campaign.tests, values, strict=True):
        estimate = test.estimate
        sigma = 0.01 * np.sqrt((np.abs(exact) ** 2).mean(axis=(0, 1)))
        error = random.normal(size=(2, *exact.shape)) * sigma / np.sqrt(2)
        frf = replace(estimate.frf, values=exact + error[0] + 1j * error[1])
        variance = np.full(exact.shape, sigma**2)
        tests.append(replace(test, estimate=replace(estimate, frf=frf, variance=variance)))
    return replace(session, campaign=replace(session.campaign, tests=tuple(tests)))


def test_a_machine_that_has_the_laws_as_drawn_lacks_nothing(folder):
    session, random = open_session(folder), np.random.default_rng(7)
    spread = np.where(session.parametrisation.is_tolerance, 0.7, 0.2)
    theta = session.parametrisation.theta(random.normal(0.0, spread))
    diagnosis = diagnose(measured(session, theta, random))
    assert build_verdict(diagnosis).verdict == "none"
    assert diagnosis.null.summary.chi_square == pytest.approx(1.0, abs=0.1)


def test_a_candidate_measures_what_is_beyond_the_drawn_law(folder):
    session = open_session(folder)
    scene = Scene(session, session.model.drawn)
    loss = next(h for h in EFFECTS["structural_damping"](scene) if h.location == "joint:stage2")
    model = replace(session.model, parts=(*session.model.parts, *loss.parts))
    theta = model.drawn.copy()
    names = [parameter.name for parameter in model.parameters]
    theta[names.index(loss.scored[0])] = 0.04
    twice = STATED.replace("0.08", "0.12")
    other = folder / "twice.toml"
    other.write_text((folder / "campaign.toml").read_text().replace(STATED, twice))
    more = open_session(other)
    np.testing.assert_allclose(
        line_by_line(model, theta, session.campaign),
        line_by_line(more.model, more.model.drawn, session.campaign),
        rtol=1e-9,
    )
