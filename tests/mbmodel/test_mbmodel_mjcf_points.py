"""Which sites are sensors, and one name on elements of several kinds."""

import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf

from identification.words import Dof, InputError, Signal
from mbmodel import FrfRequest, as_drawn, linearise, parse_input, sensor_parts
from mbw.site_kinds import sensor_sites

GOOD = mjcf(mass_on_spring(4, 3e4, 7))


def with_sites(*names, tendon=(), actuator=""):
    """Return a mass with sites, of which some are ends of a tendon; the other end stands still."""
    sites = "".join(f'<site name="{name}" pos="0 0 {0.1 * k}"/>' for k, name in enumerate(names))
    body = mass_on_spring(4, 3e4, 7).replace('<site name="acc1"/>', sites)
    path = "".join(f'<site site="{name}"/>' for name in ("base1", *tendon))
    ropes = f'<tendon><spatial name="rope" stiffness="9">{path}</spatial></tendon>'
    after = (ropes if tendon else "") + f"<actuator>{actuator}</actuator>"
    return mjcf('<site name="base1" pos="0 0 -1"/>' + body).replace(
        "</mujoco>", f"{after}</mujoco>"
    )


@pytest.mark.parametrize(
    ("text", "sensors"),
    [
        (with_sites("acc1", "acc2", "leg1", tendon=["leg1"]), ["acc1", "acc2"]),
        (with_sites("leg1", "acc1", tendon=["leg1"]), ["acc1"]),
        (with_sites("acc1", "top1"), ["acc1"]),
        (with_sites("acc1", "leg2", tendon=["leg2"]), ["acc1"]),
        (with_sites("acc1", "leg2"), ["acc1", "leg2"]),
        (with_sites("acc1", "acc2", tendon=["acc2"]), ["acc1", "acc2"]),
        (with_sites("p1", "p2", tendon=["p2"]), ["p1", "p2"]),
        (with_sites("acc1", "m2", actuator='<motor name="m" site="m2"/>'), ["acc1"]),
        (with_sites("acc1", "hit1", "hit2"), ["acc1"]),
    ],
)
def test_sites_that_hold_tendons_are_no_sensors(from_text, text, sensors):
    machine = from_text(text)
    assert sensor_sites(machine.layout) == sensors
    assert [part.location for part in sensor_parts(machine)] == [f"sensor:{s}" for s in sensors]
    for name in sensors:
        assert machine.layout.sensor_at_node(int(name[-1])) == name


def test_the_end_of_a_tendon_remains_a_point_of_labels(from_text):
    machine = from_text(with_sites("acc1", "leg1", tendon=["leg1"]))
    assert machine.layout.rows([Dof("leg1", "+tz")])[0, 2] == 1.0
    assert machine.layout.sensor_at_node(1) == "acc1"
    assert machine.layout.hammer_at_node(1) == "acc1"


def test_two_accelerometers_of_one_node_are_refused(from_text):
    with pytest.raises(InputError, match=r"'acc1' and 'acc01' both end in node 1: renumber one"):
        from_text(with_sites("acc1", "acc01", "top1"))


def test_one_name_on_body_joint_site_geom_and_motor(from_text):
    text = (
        '<body name="a"><joint name="a" type="slide" axis="0 0 1" stiffness="3e4" damping="7"/>'
        '<geom name="a" size=".1" mass="4"/><site name="a" pos="0.3 0 0"/>'
        '<site name="acc1"/></body>'
    )
    machine = from_text(
        mjcf(text).replace("</mujoco>", '<actuator><motor name="a" joint="a"/></actuator></mujoco>')
    )
    (remark,) = machine.remarks
    assert "site 'a' has the name of a body" in remark
    model = as_drawn(machine)
    inputs = (parse_input(machine, "a"), parse_input(machine, "a:+tz"))
    assert isinstance(inputs[0], Signal)
    request = FrfRequest(np.array([3.0, 20.0]), (Dof("a", "+tz"),), inputs)
    values = linearise(model, model.drawn, request).values
    np.testing.assert_allclose(values[:, :, 0], values[:, :, 1], rtol=1e-12)
    assert [parameter.name for parameter in model.parameters] == ["a.stiffness", "a.damping"]


@pytest.mark.parametrize("kind", ["hit1", "acc1"])
def test_a_sensor_or_hammer_point_named_like_a_body_is_refused_with_both(from_text, kind):
    text = GOOD.replace('name="a"', f'name="{kind}"').replace("acc1", kind)
    with pytest.raises(InputError, match=f"body '{kind}' and site '{kind}' share a name"):
        from_text(text)


def test_a_numbered_site_named_like_a_body_carries_no_sensor(from_text):
    machine = from_text(GOOD.replace('name="a"', 'name="low1"').replace("acc1", "low1"))
    assert machine.remarks[0].endswith("mean the body's centre of mass, and it carries no sensor")
    assert machine.layout.points == ()


def test_meshes_that_are_discarded_for_display_change_nothing(from_text):
    corners = 'vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"'
    text = mjcf(
        '<body name="a"><joint name="j" type="slide" axis="0 0 1" stiffness="4000"/>'
        '<geom type="mesh" mesh="body"/><geom type="mesh" mesh="seen" contype="0" conaffinity="0"/>'
        '<geom size=".02" contype="0" conaffinity="0"/><site name="acc1"/></body>',
        extra=f'<asset><mesh name="seen" {corners}/><mesh name="body" {corners}/></asset>',
    )
    machine = from_text(text)
    discarding = from_text(text.replace("<compiler", '<compiler discardvisual="true"'))
    np.testing.assert_array_equal(discarding.body_mass, machine.body_mass)
    volume = 2 * 0.1**3 / 6 + 4 / 3 * np.pi * 0.02**3
    assert machine.body_mass[0, 0] == pytest.approx(1000 * volume, rel=1e-6)
