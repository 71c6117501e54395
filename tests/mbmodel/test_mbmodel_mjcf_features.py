"""Features of MJCF: each agrees with MuJoCo's own slopes, or is refused by the element's name."""

import mujoco
import numpy as np
import pytest
from test_mbmodel_mujoco import accelerations

from identification.words import InputError
from mbmodel import as_drawn, load_machine, modes_of_matrices
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.mjcf.keyframes import pose_data
from mbmodel.mjcf.read import compile_mjcf

BOX = '<geom type="box" size=".1 .2 .15" mass="10" contype="0" conaffinity="0"/>'
SPRINGS = (
    '<joint name="x" type="slide" axis="1 0 .1" stiffness="4000" damping="2"/>'
    '<joint name="r" axis="0 1 0" pos=".1 0 .3" stiffness="300" damping=".5"/>'
)
BASE = f'<site name="w" pos=".3 .2 1"/><body name="a">{SPRINGS}{BOX}<site name="acc1"/></body>'
ARM = (
    '<body name="b" pos=".2 .1 0"><joint name="s" axis=".2 1 0" stiffness="90" damping=".2"/>'
    '<geom name="bar" type="capsule" size=".05" fromto="0 0 0 .4 0 .1" mass="3" contype="0" '
    'conaffinity="0"/><site name="acc2" pos=".3 0 0"/></body>'
)
TWO = BASE.replace("</body>", ARM + "</body>")


def model_text(bodies=BASE, before="", after=""):
    return f"<mujoco>{before}<worldbody>{bodies}</worldbody>{after}</mujoco>"


def with_actuator(element, before="", bodies=BASE):
    return model_text(bodies, before, f"<actuator>{element}</actuator>")


def with_joint(attributes, before=""):
    return model_text(BASE.replace('name="r"', f'name="r" {attributes}'), before)


def with_option(option, bodies=TWO, after=""):
    return model_text(bodies, f"<option {option}", after)


TENDON = (
    '<tendon><spatial name="t" stiffness="700" damping="3" springlength=".4">'
    '<site site="w"/><site site="acc1"/></spatial></tendon>'
)
EQUALITY = '<equality><weld name="glue" body1="a" body2="b"/></equality>'

AGREES = {
    "two motors at joints beyond the sites": with_actuator(
        '<motor name="m" joint="x"/><motor name="n" joint="r" gear="3"/>'
    ),
    "position servo": with_actuator('<position name="p" joint="r" kp="200" kv="3"/>'),
    "position servo with dampratio": with_actuator(
        '<position name="p" joint="r" kp="200" dampratio="0.3"/>'
    ),
    "velocity servo": with_actuator('<velocity name="p" joint="x" kv="30"/>'),
    "general with affine bias": with_actuator(
        '<general name="p" joint="x" gaintype="affine" gainprm="10 2 1" biastype="affine" '
        'biasprm="1 -300 -4"/>'
    ),
    "servo whose control range leaves out 0": with_actuator(
        '<position name="p" joint="r" kp="200" ctrlrange="0.1 0.3"/>'
    ),
    "servo at a fixed tendon": model_text(
        TWO,
        after='<tendon><fixed name="f"><joint joint="x" coef="1"/><joint joint="s" coef="-.4"/>'
        '</fixed></tendon><actuator><position name="p" tendon="f" kp="500"/></actuator>',
    ),
    "servo at a spatial tendon": model_text(
        after=TENDON + '<actuator><position name="p" tendon="t" kp="500"/></actuator>'
    ),
    "servo at a site with refsite": with_actuator(
        '<position name="p" site="acc1" refsite="w" kp="400" gear="0 0 1 0 0.2 0"/>'
    ),
    "wrench at a site": with_actuator('<motor name="p" site="acc1" gear="1 2 3 .1 .2 .3"/>'),
    "slider-crank": with_actuator(
        '<position name="p" cranksite="acc1" slidersite="w" cranklength="2" kp="300"/>'
    ),
    "cylinder without time constant": with_actuator(
        '<general name="p" jointinparent="r" gainprm="3" biastype="affine" biasprm="0 -50 0"/>'
    ),
    "pid without integrator": with_actuator('<pid name="p" joint="x" kp="300" kv="5"/>'),
    "dcmotor without inductance": with_actuator(
        '<dcmotor name="p" joint="r" resistance="2" motorconst="0.5 0.5"/>'
    ),
    "passive dcmotor": with_actuator(
        '<dcmotor name="p" joint="r" input="none" resistance="2" motorconst=".5" '
        'cogging="4 3 0.4"/>'
    ),
    "damping of an actuator": with_actuator('<motor name="p" joint="r" damping="3" gear="2"/>'),
    "armature": with_joint('armature="0.7"'),
    "springref": with_joint('springref="0.3"', '<compiler angle="radian"/>'),
    "ref": with_joint('ref="20" springref="5"'),
    "springdamper": with_joint('springdamper="0.05 0.4"'),
    "polynomial stiffness": with_joint('springref="20"').replace(
        'stiffness="300"', 'stiffness="300 80 500"'
    ),
    "gravcomp": model_text(BASE.replace('name="a"', 'name="a" gravcomp="0.4"')),
    "fluid": with_option('density="1000" viscosity="3" wind="1 2 0"/>'),
    "ellipsoid fluid": with_option('density="1000" viscosity="3"/>').replace(
        "<geom ", '<geom fluidshape="ellipsoid" '
    ),
    "tendon springs": model_text(after=TENDON),
    "tendon armature": model_text(after=TENDON.replace("<spatial", '<spatial armature="2"')),
    "tendon with a dead band that is slack": model_text(
        after=TENDON.replace('springlength=".4"', 'springlength="0 3"')
    ),
    "tendon around a geom": model_text(
        BASE.replace("<body", '<geom name="roll" type="cylinder" size=".05 1" pos=".1 .2 .6" '
                     'euler="90 0 0" contype="0" conaffinity="0"/><site name="side" '
                     'pos=".2 .2 .6"/><body', 1),
        after=TENDON.replace(
            '<site site="w"/>', '<site site="w"/><geom geom="roll" sidesite="side"/>'
        ),
    ),
    "pulley": model_text(
        TWO,
        after='<tendon><spatial name="t" stiffness="900" springlength=".2"><pulley divisor="2"/>'
        '<site site="w"/><site site="acc1"/><pulley divisor="2"/><site site="w"/>'
        '<site site="acc2"/></spatial></tendon>',
    ),
    "degrees, other Euler sequence": with_option("/>", TWO.replace(
        'name="b"', 'name="b" euler="20 40 -30"'
    )).replace("<option /", '<compiler angle="degree" eulerseq="ZYX"/><option/'),
    "defaults and classes": model_text(
        '<body name="a" childclass="soft"><joint name="x" axis="0 1 0" pos="0 0 .4"/>'
        '<geom class="heavy" size=".1"/><site name="acc1"/></body>',
        '<default><joint stiffness="100" damping="1"/><default class="soft">'
        '<joint stiffness="700"/><geom contype="0" conaffinity="0"/><default class="heavy">'
        '<geom density="9000"/></default></default></default>',
    ),
    "frame": model_text(f'<frame pos="1 0 0" euler="30 40 0">{TWO}</frame>'),
    "replicate": model_text(
        '<replicate count="3" offset="0 0 1" euler="0 30 0"><body name="a"><joint name="x" '
        f'axis="0 1 0" pos="0 0 .4" stiffness="100"/>{BOX}</body></replicate>'
    ),
    "inertiafromgeom, inertiagrouprange": with_option("/>").replace(
        "<option />", '<compiler inertiafromgeom="true" inertiagrouprange="0 1"/>'
    ),
    "balanceinertia": model_text(
        '<body name="a"><inertial pos="0 0 .2" mass="3" diaginertia=".1 .1 .5"/>'
        '<joint name="x" axis="0 1 0" stiffness="100"/></body>',
        '<compiler balanceinertia="true"/>',
    ),
    "settotalmass, which is deprecated": model_text(TWO, '<compiler settotalmass="40"/>'),
    "boundmass": model_text(TWO, '<compiler boundmass="7" boundinertia=".3"/>'),
    "fusestatic": model_text(
        BASE.replace("</body>", f'<body name="w1" pos="0 0 .3">{BOX}</body></body>'),
        '<compiler fusestatic="true"/>',
    ),
    "autolimits off": with_joint('range="-1 1" limited="false"', '<compiler autolimits="false"/>'),
    "limit that is not reached": with_joint('range="-80 80"'),
    "ball": model_text(
        f'<body name="a"><joint name="j" type="ball" pos="0 0 .5" damping="1"/>{BOX}</body>'
    ),
    "free": model_text(f'<body name="a"><freejoint name="j"/>{BOX}</body>' + BASE.replace(
        '"a"', '"c"'), '<option gravity="0 0 0"/>'),
    "mocap body that carries a stage": model_text(
        f'<body name="m" mocap="true" pos="0 0 1" euler="20 0 0">{BOX}<body name="a">{SPRINGS}'
        f'{BOX}<site name="acc1"/></body></body>'
    ),
    "mocap target without mass": model_text(
        '<body name="target" mocap="true"><geom size=".1" mass="0" contype="0" '
        'conaffinity="0"/></body>' + BASE
    ),
    "equality that is not active": with_option("/>", TWO, EQUALITY.replace(
        "<weld", '<weld active="false"')),
    "equality switched off": with_option('><flag equality="disable"/></option>', TWO, EQUALITY),
    "constraints switched off": with_option(
        '><flag constraint="disable"/></option>', TWO.replace('"s"', '"s" frictionloss="1"'),
        EQUALITY),
    "friction switched off": with_option(
        '><flag frictionloss="disable"/></option>', TWO.replace('"s"', '"s" frictionloss="1"')),
    "limit switched off": with_option(
        '><flag limit="disable"/></option>', TWO.replace('"s"', '"s" range="20 30"')),
    "contact switched off": with_option(
        '><flag contact="disable"/></option>',
        BASE + '<geom type="plane" size="1 1 1"/><body name="c">' + SPRINGS.replace(
            'name="', 'name="c') + '<geom size=".1" mass="2"/></body>'),
    "gravity switched off": with_option('><flag gravity="disable"/></option>'),
    "actuation switched off": with_actuator(
        '<position name="p" joint="r" kp="200"/>',
        '<option><flag actuation="disable"/></option>'),
    "actuators of one group switched off": with_actuator(
        '<position name="p" joint="r" kp="200" group="2"/>',
        '<option actuatorgroupdisable="2"/>'),
    "clamping of controls switched off": with_actuator(
        '<position name="p" joint="r" kp="200" ctrlrange=".1 .3"/>',
        '<option><flag clampctrl="disable"/></option>'),
    "flags of the solver": with_option(
        '><flag warmstart="disable" eulerdamp="disable" island="disable" energy="enable" '
        'fwdinv="enable" sensor="disable" invdiscrete="enable" diagexact="enable"/></option>'),
    "implicit integrator": with_option('integrator="implicitfast" timestep="0.02"/>'),
    "cameras, lights, sites of other shapes": model_text(
        TWO.replace("</body>", '<camera name="eye" pos="0 0 1"/><light pos="0 0 1"/>'
                    '<site name="cube" type="box" size=".1 .1 .1"/></body>', 1)),
    "elastic joint that yields": with_joint('springyield="50"'),
}  # fmt: skip

AGREES |= {
    "elastic solid of flexible elements": model_text(
        BASE + '<flexcomp name="f" type="grid" count="3 3 3" spacing=".1 .1 .1" pos="0 0 2" '
        'mass="1" dim="3" radius=".001"><contact contype="0" conaffinity="0" selfcollide="none"/>'
        '<elasticity young="1e5" poisson=".2" damping="0.01"/><pin id="0 1 2 3 4 5 6 7 8"/>'
        "</flexcomp>"
    ),
    "height field": model_text(
        '<geom type="hfield" hfield="h" contype="0" conaffinity="0"/>' + BASE,
        '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1" elevation="0 0 1 0"/></asset>',
    ),
    "mesh that MuJoCo makes": model_text(
        '<body name="a"><joint name="j" axis="0 1 0" stiffness="30"/>'
        '<geom type="mesh" mesh="m"/></body>',
        '<asset><mesh name="m" builtin="sphere" params="2"/></asset>',
    ),
    "sensors and a contact that is not closed": model_text(
        '<geom name="ground" type="plane" size="1 1 1" pos="0 0 -9"/>' + TWO,
        after='<contact><pair geom1="ground" geom2="bar"/></contact><sensor>'
        '<accelerometer site="acc1"/><force site="acc1"/></sensor>',
    ),
    "servo between a site on the ground and one on a body": with_actuator(
        '<position name="p" site="w" refsite="acc1" kp="400" gear="1 0 1 0 0.2 0"/>'
    ),
    "motors at a ball and at a free body": model_text(
        f'<body name="a"><joint name="j" type="ball" pos="0 0 .5" damping="1"/>{BOX}</body>'
        f'<body name="c"><freejoint name="f"/>{BOX}</body>',
        '<option gravity="0 0 0"/>',
        '<actuator><motor name="p" jointinparent="j" gear="1 2 3"/>'
        '<position name="q" joint="j" kp="50" gear="1 0 0"/>'
        '<motor name="r" joint="f" gear="1 2 3 .1 .2 .3"/></actuator>',
    ),
    "free body on a tendon": model_text(
        f'<site name="w" pos="0 0 1"/><body name="a"><freejoint name="j"/>{BOX}'
        '<site name="acc1"/></body>', after=TENDON
    ),
    "attitude servo with three controls": model_text(
        f'<body name="a"><joint name="j" type="ball" pos="0 0 .5" damping="1"/>{BOX}</body>',
        after='<actuator><general name="p" joint="j" gaintype="so3" biastype="so3" gainprm="5" '
        'biasprm="0 -5 -1"/></actuator>',
    ),
    "controllers with several controls": with_actuator(
        '<pid name="p" joint="x" kp="300" kv="5" input="pos vel ff"/>'
        '<dcmotor name="q" joint="r" resistance="2" motorconst=".5" controller="30 0 2" '
        'input="pos vel"/>'
    ),
    "filtered servo": with_actuator('<position name="p" joint="x" kp="300" timeconst=".1"/>'),
    "integrated velocity": with_actuator(
        '<intvelocity name="p" joint="x" kp="300" actrange="-1 1"/>'
    ),
    "muscle": with_actuator('<muscle name="p" joint="x" lengthrange="0.01 1"/>'),
    "polynomial damping": with_joint("").replace('damping=".5"', 'damping=".5 3 1"'),
    "polynomial tendon": model_text(
        after=TENDON.replace('"700"', '"700 400 900"').replace('damping="3"', 'damping="3 1"')
    ),
    "tendon that would yield later": model_text(
        after=TENDON.replace("<spatial", '<spatial springyield="5"')
    ),
    "trees that sleep at the start": with_option(
        '><flag sleep="enable"/></option>'
    ).replace('name="a"', 'name="a" sleep="init"'),
}  # fmt: skip

REFUSED = {
    "dcmotor with inductance": (
        with_actuator('<dcmotor name="p" joint="r" resistance="2" motorconst=".5" '
                      'inductance=".1 0"/>'), ["actuator 'p'", "state"]),
    "dcmotor with friction of LuGre": (
        with_actuator('<dcmotor name="p" joint="r" resistance="2" motorconst=".5" '
                      'lugre="10 1 1 2 .1"/>'), ["actuator 'p'", "state"]),
    "pid with integrator": (
        with_actuator('<pid name="p" joint="x" kp="300" ki="5"/>'), ["actuator 'p'", "state"]),
    "armature of an actuator": (
        with_actuator('<motor name="p" joint="x" armature="1"/>'), ["actuator 'p'", "armature"]),
    "tie of sites without a name": (
        model_text(TWO, after='<equality><connect site1="w" site2="acc2"/></equality>'),
        ["equality constraint (connect) of 'w' and 'acc2'"]),
    "saturated actuator": (
        with_actuator('<general name="p" joint="x" gainprm="1" biastype="affine" biasprm="9 0 0" '
                      'forcerange="-5 5"/>'), ["actuator 'p'", "forcerange"]),
    "force range of one side": (
        with_actuator('<motor name="p" joint="x" forcerange="0 5"/>'),
        ["actuator 'p'", "forcerange"]),
    "tendon at the end of its dead band": (
        with_option('gravity="0 0 0"/>', BASE, TENDON.replace(
            'springlength=".4"', 'springlength="0 1.0630145812734649"')), ["joint 'x'", "side"]),
    "springs switched off": (
        with_option('><flag spring="disable"/></option>'), ['flag spring="disable"']),
    "dampers switched off": (
        with_option('><flag damper="disable"/></option>'), ['flag damper="disable"']),
    "gravity compensated by actuators": (
        with_joint('actuatorgravcomp="true"').replace('name="a"', 'name="a" gravcomp="1"'),
        ["joint 'r'", "actuatorgravcomp"]),
    "limit that is reached": (with_joint('range="20 80"'), ["limit of joint 'r'"]),
    "edges of a flexible sheet": (
        model_text(BASE + '<flexcomp name="f" type="grid" count="3 3 1" spacing=".1 .1 .1" '
                   'mass="1" dim="2" radius=".001"><edge equality="true"/></flexcomp>'),
        ["equality constraint"]),
    "spring that yields at rest": (
        with_joint('springyield="0.5"'), ["spring of joint 'r'", "springyield"]),
    "tendon that yields at rest": (
        model_text(after=TENDON.replace("<spatial", '<spatial springyield=".1"')),
        ["spring of tendon 't'", "springyield"]),
    "force range of a joint that is reached": (
        with_joint('actuatorfrcrange="-1 1"').replace(
            "</mujoco>", '<actuator><general name="p" joint="r" gainprm="5" biastype="affine" '
            'biasprm="9 0 0"/></actuator></mujoco>'), ["actuator 'p'", "actuatorfrcrange"]),
    "contact within its margin": (
        model_text('<geom name="ground" type="plane" size="1 1 1" pos="0 0 -.26" margin=".2" '
                   'gap=".2"/>' + BASE.replace('contype="0" conaffinity="0"', "")),
        ["contact between geom 'ground'"]),
    "delayed control": (
        with_actuator('<motor name="p" joint="x" delay=".01" nsample="3"/>'),
        ["actuator 'p'", "delay"]),
    "a part out of all scale": (
        model_text(TWO.replace('pos=".2 .1 0"', 'pos=".2 1e8 0"')), ["machine.xml", "scale"]),
    "a ball that turns about a point out of all scale": (
        model_text(f'<body name="a"><joint name="j" type="ball" pos="1 0 1e11"/>{BOX}</body>'),
        ["joint 'j'", "scale"]),
    "composite, which MuJoCo 4 lacks": (
        model_text('<body name="k"><composite type="cable" curve="s" count="5 1 1" size="1"/>'
                   "</body>"), ["composite"]),
    "plugin that is not there": (
        model_text(TWO, '<extension><plugin plugin="nobody.knows"/></extension>'), ["plugin"]),
}  # fmt: skip


def save(tmp_path, text):
    path = tmp_path / "machine.xml"
    path.write_text(text, encoding="utf-8")
    return path


def assert_agrees(path, key=None):
    """Compare matrices and modes with fourth-order differences of MuJoCo's own accelerations."""
    machine = load_machine(path, key=key)
    model = compile_mjcf(path)
    rest = find_equilibrium(model, path, pose_data(model, machine.keyframe)).data
    drawn = as_drawn(machine)
    matrices = drawn.matrices(drawn.drawn)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, rest, mass)
    np.testing.assert_allclose(matrices.mass, mass, rtol=1e-9, atol=1e-12 * np.abs(mass).max())
    by_position, by_velocity = accelerations(path, rest.qpos, start=rest)
    for matrix, slope in ((matrices.stiffness, by_position), (matrices.damping, by_velocity)):
        acceleration = -np.linalg.solve(matrices.mass, matrix)
        assert np.abs(acceleration - slope).max() < 1e-6 * max(np.abs(by_position).max(), 1.0)
    first_order = np.block([[np.zeros_like(mass), np.eye(len(mass))], [by_position, by_velocity]])
    poles = np.linalg.eigvals(first_order)
    own = modes_of_matrices(matrices).poles
    for pole in own[np.abs(own) > 1.0]:
        assert np.abs(poles - pole).min() < 1e-5 * abs(pole)
    return machine


@pytest.mark.parametrize("case", AGREES)
def test_a_feature_agrees_with_mujocos_own_slopes(tmp_path, case):
    assert_agrees(save(tmp_path, AGREES[case]))


@pytest.mark.parametrize("case", REFUSED)
def test_a_feature_without_a_linear_model_is_refused_by_name(tmp_path, case):
    text, words = REFUSED[case]
    with pytest.raises(InputError) as caught:
        load_machine(save(tmp_path, text))
    for word in words:
        assert word in str(caught.value)


def test_every_control_is_an_input_with_its_own_force(tmp_path):
    # kp (u_pos - l) + kv (u_vel - v) + u_ff at a slide along a unit axis.
    machine = load_machine(save(tmp_path, AGREES["controllers with several controls"]))
    assert list(machine.motors) == ["p.0", "p.1", "p.2", "q.0", "q.1"]
    forces = [machine.motors[name].joint for name in machine.motors]
    expected = np.outer([300, 5, 1, 0, 0], [1, 0]) + np.outer([0, 0, 0, 30, 2], [0, 1])
    np.testing.assert_allclose(forces, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("case", ["actuation switched off", "actuators of one group switched off"])
def test_an_actuator_that_is_switched_off_is_no_input_and_no_spring(tmp_path, case):
    machine = load_machine(save(tmp_path, AGREES[case]))
    assert not machine.motors
    assert not machine.remaining_stiffness.any()
    assert any("'p' exert no force at rest" in remark for remark in machine.remarks)
