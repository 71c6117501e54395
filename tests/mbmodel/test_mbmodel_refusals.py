"""What has no linear model is refused with the file, the element and a remedy."""

import re

import pytest
from mbmodel_examples import mass_on_spring, mjcf

from identification.words import ConvergenceError, InputError
from mbmodel import as_drawn, load_machine

GOOD = mjcf(mass_on_spring(4, 3e4, 7))


def with_extra(text):
    return GOOD.replace("</mujoco>", text + "</mujoco>")


def joint(attributes):
    changed = re.sub(r' stiffness="[^"]*" damping="[^"]*"', f" {attributes}", GOOD, count=1)
    assert changed != GOOD
    return changed


FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'
BOX = '<geom name="foot" type="box" size="0.1 0.1 0.1"/>'

REFUSED = {
    "unknown attribute": (joint('stifness="3"'), ["stifness", "joint", "line 1"]),
    "unknown element": (with_extra("<spring/>"), ["spring"]),
    "body without mass": (
        mjcf('<body name="bare"><joint type="slide"/></body>'),
        ["body 'bare'", "no mass", "<inertial>"],
    ),
    "inner body without mass": (
        GOOD.replace("<site", '<body name="inner"><joint axis="1 0 0"/></body><site', 1),
        ["body 'inner'", "no mass"],
    ),
    "negative stiffness": (joint('stiffness="-3"'), ["joint 'a_j'", "stiffness -3", "0 or more"]),
    "negative damping": (joint('damping="-0.5"'), ["joint 'a_j'", "damping -0.5", "0 or more"]),
    "infinite stiffness": (joint('stiffness="inf"'), ["joint 'a_j'", "stiffness='inf'"]),
    "not a number in stiffness": (joint('stiffness="nan"'), ["joint 'a_j'", "stiffness='nan'"]),
    "not a number in damping": (joint('damping="nan"'), ["joint 'a_j'", "damping='nan'"]),
    "negative tendon stiffness": (
        with_extra(
            '<tendon><fixed name="t" stiffness="-1e9">'
            '<joint joint="a_j" coef="1"/></fixed></tendon>'
        ),
        ["joint 'a_j' with tendon 't'", "stiffness -"],
    ),
    "tendon friction": (
        with_extra(
            '<tendon><fixed name="t" frictionloss="1">'
            '<joint joint="a_j" coef="1"/></fixed></tendon>'
        ),
        ["tendon 't'", "frictionloss"],
    ),
    "contact": (
        mjcf(FLOOR + mass_on_spring(4, 3e4, 7, pos="0 0 0.05").replace("<site", BOX + "<site")),
        ["geom 'floor'", "geom 'foot' of body 'a'", "contype"],
    ),
    "equality": (
        with_extra('<equality><joint name="gear" joint1="a_j"/></equality>'),
        ["equality constraint 'gear'", "nothing move"],
    ),
    "dry friction": (joint('frictionloss="2"'), ["joint 'a_j'", "frictionloss", "remove"]),
    "joint limit": (joint('limited="true" range="0.1 1"'), ["limit of joint 'a_j'", "widen"]),
    "tendon limit": (
        with_extra(
            '<tendon><fixed name="t" limited="true" range="0.1 1">'
            '<joint joint="a_j" coef="1"/></fixed></tendon>'
        ),
        ["limit of tendon 't'", "widen"],
    ),
    "two sites with one node": (
        GOOD.replace("acc1", "low1").replace("<site", '<site name="top1"/><site', 1),
        ["'top1'", "'low1'", "node 1", "renumber"],
    ),
    "two sites with one node, written otherwise": (
        GOOD.replace("<site", '<site name="acc01"/><site', 1),
        ["'acc01'", "'acc1'", "node 1"],
    ),
    "a sensor named like a body": (
        GOOD.replace('"a"', '"acc1"'),
        ["body 'acc1' and site 'acc1'", "rename"],
    ),
    "ball with stiffness": (
        mjcf('<body name="a"><joint name="b" type="ball" stiffness="3"/><geom size="1"/></body>'),
        ["joint 'b'", "ball", "three hinges"],
    ),
    "no joints": (mjcf('<body name="a"><geom size="1"/></body>'), ["no body has a joint"]),
    "an actuator with delay": (
        with_extra(
            '<actuator><position name="servo" joint="a_j" kp="100" delay="0.01" nsample="4"/>'
            "</actuator>"
        ),
        ["servo"],
    ),
    "an actuator with a state": (
        with_extra(
            '<actuator><general name="servo" joint="a_j" dyntype="user" actdim="1" '
            'gainprm="100" biastype="affine" biasprm="0 -100 0"/></actuator>'
        ),
        ["servo"],
    ),
    "a tendon named like a joint": (
        with_extra(
            '<tendon><fixed name="a_j" stiffness="1"><joint joint="a_j" coef="1"/></fixed></tendon>'
        ),
        ["a_j"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_machine_without_a_linear_model_is_refused_by_name(tmp_path, monkeypatch, case):
    # MuJoCo writes its warnings (a NaN in the XML) into the working folder.
    monkeypatch.chdir(tmp_path)
    text, words = REFUSED[case]
    path = tmp_path / "broken.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        as_drawn(load_machine(path))
    message = str(caught.value)
    assert message.startswith(str(path))
    for word in words:
        assert word in message


def test_the_machine_that_the_refusals_start_from_is_accepted(from_text):
    assert from_text(GOOD).coordinates == ("a_j",)


def test_a_missing_file_is_named(tmp_path):
    path = tmp_path / "absent.xml"
    with pytest.raises(InputError, match=r"absent\.xml does not exist"):
        load_machine(path)


def test_a_folder_is_no_machine(tmp_path):
    with pytest.raises(InputError, match="is a folder: give the path of an MJCF file"):
        load_machine(tmp_path)


@pytest.mark.parametrize(
    ("text", "line"),
    [("<mujoco>\n<worldbody>\n</mujoco>", 3), ("", 1), ("\n\nhello", 3), ("<mujoco>\n<a b=c/>", 2)],
)
def test_a_file_that_is_no_xml_is_refused_with_its_line(tmp_path, text, line):
    path = tmp_path / "broken.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"broken\.xml, line {line}: not well-formed"):
        load_machine(path)


def test_another_kind_of_xml_is_refused(tmp_path):
    path = tmp_path / "page.xml"
    path.write_text("<html><body/></html>", encoding="utf-8")
    with pytest.raises(InputError, match=r"page\.xml: MuJoCo refuses it"):
        load_machine(path)


def test_a_limit_that_is_not_reached_is_no_obstacle(from_text):
    limited = joint('stiffness="3e4" limited="true" range="-0.1 1"')
    assert from_text(limited).springs[0].stiffness == 3e4


def test_a_contact_that_is_switched_off_is_no_obstacle(from_text):
    off = BOX.replace("/>", ' contype="0" conaffinity="0"/>')
    text = mjcf(FLOOR + mass_on_spring(4, 3e4, 7, pos="0 0 0.05").replace("<site", off + "<site"))
    assert from_text(text).springs[0].stiffness == 3e4


def test_a_sensor_and_a_hammer_point_may_share_a_node(from_text):
    machine = from_text(GOOD.replace("<site", '<site name="hit1"/><site', 1))
    assert (machine.layout.sensor_at_node(1), machine.layout.hammer_at_node(1)) == ("acc1", "hit1")


def test_a_block_that_rests_on_its_contacts_is_told_of_them(from_text):
    # It has no equilibrium without the contact, and the contact is what cannot be linearised.
    block = '<body name="block" pos="0 0 0.099"><freejoint name="f"/>' + BOX + "</body>"
    with pytest.raises((InputError, ConvergenceError), match="contact between"):
        from_text(mjcf(FLOOR + block, gravity="0 0 -9.81"))


def test_thousands_of_contacts_are_told_by_one(from_text):
    # MuJoCo's solver of constraints has no memory for them and would stop the program.
    chain = '<body><joint type="slide" stiffness="1e5"/><geom size="0.1"/>'
    with pytest.raises(InputError, match="contact between a geom of body 'body1'"):
        from_text(mjcf(chain * 100 + "</body>" * 100))
