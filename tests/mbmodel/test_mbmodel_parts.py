"""Mass, inertia, centre of mass, joints, sensors, hammer as Parts.

Each finite change equals the machine rebuilt from its MJCF, each slope the differences of finite
changes, each gradient the slopes.
"""

from dataclasses import replace

import numpy as np
import pytest
from mbmodel_examples import (
    mass_on_spring,
    mjcf,
    numbers,
    random_tree,
    some_dofs,
    worst_of_channels,
)
from scipy.spatial.transform import Rotation
from test_mbmodel_slopes import assert_gradient_is_contraction, worst_column

from identification.words import Dof
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    NotInMjcf,
    as_drawn,
    body_parts,
    hammer_parts,
    joint_parts,
    linearise,
    load_machine,
    model_edits,
    sensor_parts,
    spring_parts,
    write_mjcf,
)

FREQ = np.array([4.0, 17.0, 30.5, 44.0, 60.0, 81.0, 117.0, 160.0, 233.0])
SIZES = {  # steps to take from the drawing: relative to the drawn value, else absolute
    "mass": 0.2,
    "inertia": 0.1,
    "com": 0.02,
    "joint_position": 0.02,
    "joint_rotation": 0.1,
    "gain": 0.2,
    "cross": 0.1,
    "delay": 1e-3,
    "rotation": 0.3,
    "position": 0.03,
    "stiffness": 0.3,
    "damping": 0.3,
}


def size_of(parameter):
    word = parameter.name.rsplit(".", 1)[1]
    size = next(size for start, size in SIZES.items() if word.startswith(start))
    return size * (parameter.drawn or 1.0)


def off(model, seed=1, amount=1.0):
    """Theta off the drawing, every entry by its own part of its size."""
    rng = np.random.default_rng(seed)
    sizes = np.array([size_of(parameter) for parameter in model.parameters])
    changes = amount * sizes * rng.uniform(-1, 1, len(sizes))
    undrawn = [parameter.known == "undrawn_damping" for parameter in model.parameters]
    return model.drawn + np.where(undrawn, np.abs(changes), changes)


def sensors(machine, count=6, seed=3):
    """Outputs at sites only, along drawn axes, and inputs likewise."""
    rng = np.random.default_rng(seed)
    every = [
        Dof.of(p, a, int(rng.choice([-1, 1]))) for p in machine.layout.points for a in range(6)
    ]
    chosen = [every[k] for k in rng.permutation(len(every))]
    return tuple(chosen[:count]), tuple(chosen[count : count + 2])


def ask(machine, **changed):
    outputs, inputs = sensors(machine)
    return FrfRequest(FREQ, outputs, inputs, **changed)


def sprung_pendulum(seed=0):
    """Stages under gravity that sag little and swing: a pendulum on a sprung stage, skew."""
    turn = numbers(Rotation.random(random_state=seed).as_quat())
    bob = (
        '<body name="bob" pos="0.02 0 -0.1"><inertial pos="0.0 0 -0.4" mass="3" '
        'fullinertia="0.11 0.12 0.05 0.001 0.002 0.003"/>'
        '<joint name="swing" type="hinge" axis="0 1 0" damping="0.02"/>'
        '<joint name="across" type="hinge" axis="1 0 0" pos="0 0 -0.05" damping="0.03"/>'
        f'<site name="acc2" pos="0.03 0.01 -0.5" quat="{turn}"/></body>'
    )
    stage = mass_on_spring(4.0, 3e4, 11.0, axis="1 0 0.3")
    tilt = (
        '<joint name="tilt" type="hinge" axis="0 1 0" pos="0 0 0.1" stiffness="900" damping="1"/>'
    )
    return mjcf(
        stage.replace("<site", tilt + "<site").replace("</body>", bob + "</body>"),
        gravity="0.3 0 -9.81",
    )


FAMILIES = {
    "bodies": body_parts,
    "joints": joint_parts,
    "sensors": sensor_parts,
}


@pytest.fixture(scope="module", params=["station", "skew", "pendulum"])
def machine(request, station, from_text):
    if request.param == "station":
        return station
    return from_text(random_tree(4, n_body=3) if request.param == "skew" else sprung_pendulum())


def differences(model, theta, frf_request, step=5e-3):
    """Sixth-order central differences of the direct solve by each parameter in its own size.

    Rounding leaves 1e-14 / step of H, 2e-12; the truncation at the tested damping is below 1e-9 of
    a column, as it must be for ``worst_column`` to stay below 1e-6 where columns are small.
    """
    evaluator = Evaluator(model, frf_request, direct=True)
    columns = []
    for k, parameter in enumerate(model.parameters):
        move = step * size_of(parameter) * np.eye(len(theta))[k]

        def pair(scale, move=move):
            return (
                evaluator.at(theta + scale * move).values
                - evaluator.at(theta - scale * move).values
            )

        columns.append((45 * pair(1) - 9 * pair(2) + pair(3)) / 60)
    return np.stack(columns, axis=-1) / step


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("quantity", ["accelerance", "receptance"])
def test_columns_are_differences_of_finite_changes(machine, family, quantity):
    model = Model(machine, FAMILIES[family](machine)[:3] + spring_parts(machine)[:1])
    theta, frf_request = off(model), ask(machine, quantity=quantity)
    lines = linearise(model, theta, frf_request)
    sizes = np.array([size_of(parameter) for parameter in model.parameters])
    expected = differences(model, theta, frf_request)
    assert worst_column(lines.columns() * sizes, expected, lines.values) < 1e-6


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("changed", [{}, {"quantity": "receptance"}, {"window_tau": 0.2}], ids=str)
def test_the_gradient_is_the_columns_times_the_cotangent(machine, family, changed):
    model = Model(machine, FAMILIES[family](machine) + spring_parts(machine))
    assert_gradient_is_contraction(linearise(model, off(model), ask(machine, **changed)))


def everything(machine, inputs):
    return Model(
        machine,
        spring_parts(machine)
        + body_parts(machine)
        + joint_parts(machine)
        + sensor_parts(machine)
        + hammer_parts(machine, inputs),
    )


def test_the_gradient_of_everything_at_once_is_the_columns_times_the_cotangent(machine):
    frf_request = ask(machine)
    model = everything(machine, frf_request.inputs)
    assert_gradient_is_contraction(linearise(model, off(model, amount=0.3), frf_request))


def test_hammer_columns_are_differences_and_move_their_own_input_only(machine):
    frf_request = ask(machine)
    model = Model(machine, hammer_parts(machine, frf_request.inputs[:1]))
    theta = off(model)
    lines = linearise(model, theta, frf_request)
    sizes = np.array([size_of(parameter) for parameter in model.parameters])
    columns = lines.columns() * sizes
    assert not columns[:, :, 1].any()
    expected = differences(model, theta, frf_request)[:, :, :1]
    assert worst_column(columns[:, :, :1], expected, lines.values[:, :, :1]) < 1e-6
    assert_gradient_is_contraction(lines)


def test_the_hammer_of_one_direction_leaves_the_sensor_there_alone(station):
    outputs, inputs = (Dof("acc11", "+ty"),), (Dof("acc11", "+tx"), Dof("acc11", "+ty"))
    model = Model(station, hammer_parts(station, inputs[:1]))
    theta = np.array([0.1, -0.2, 0.3, 0.01, 0.02, -0.03])
    frf_request = FrfRequest(FREQ, outputs, inputs)
    drawn, hit = (linearise(model, t, frf_request).values for t in (model.drawn, theta))
    np.testing.assert_array_equal(hit[:, 0, 1], drawn[:, 0, 1])
    assert (np.abs(hit[:, 0, 0] - drawn[:, 0, 0]) > 1e-3 * np.abs(drawn[:, 0, 0])).all()


def rebuilt(model, theta, tmp_path):
    target = tmp_path / "rebuilt.xml"
    assert write_mjcf(model.machine.source, target, model_edits(model, theta)) == ()
    missing = [edit for edit in model_edits(model, theta) if isinstance(edit, NotInMjcf)]
    return as_drawn(load_machine(target)), missing


def assert_rebuilt_answers_alike(model, theta, tmp_path, *, within):
    again, missing = rebuilt(model, theta, tmp_path)
    assert not missing
    outputs, inputs = sensors(model.machine)
    frf_request = FrfRequest(FREQ, outputs, inputs)
    expected = linearise(again, again.drawn, frf_request).values
    drawn = linearise(model, model.drawn, frf_request).values
    values = linearise(model, theta, frf_request).values
    assert worst_of_channels(values, expected) < within
    assert worst_of_channels(values, drawn) > 100 * within  # the change is one


@pytest.mark.parametrize("family", ["bodies", "joints"])
def test_a_finite_change_is_the_machine_rebuilt_from_its_mjcf(station, from_text, family, tmp_path):
    for machine in (station, from_text(random_tree(4, n_body=4)), from_text(random_tree(7))):
        model = Model(machine, spring_parts(machine) + FAMILIES[family](machine))
        assert_rebuilt_answers_alike(model, off(model, amount=0.3), tmp_path, within=1e-9)


def test_mass_inertia_and_joints_change_together_as_the_rebuilt_machine(station, tmp_path):
    model = Model(station, spring_parts(station) + body_parts(station) + joint_parts(station))
    # Half the steps: a flat granite has hardly less inertia about z than about x and y together,
    # and no body has more.
    assert_rebuilt_answers_alike(model, off(model, amount=0.5), tmp_path, within=1e-9)


@pytest.mark.parametrize("seed", [4, 7])
def test_displaced_and_turned_sensors_are_those_rebuilt_from_the_mjcf(from_text, seed, tmp_path):
    machine = from_text(random_tree(seed))
    model = Model(machine, spring_parts(machine) + sensor_parts(machine))
    theta = off(model)
    electric = "sensor_gain", "sensor_cross", "sensor_delay"
    of_site = np.array([parameter.known not in electric for parameter in model.parameters])
    theta = np.where(of_site, theta, model.drawn)
    again, missing = rebuilt(model, theta, tmp_path)
    assert not missing
    outputs, _ = sensors(machine)
    inputs = some_dofs(replace_points(machine), 2, 5)  # at bodies: a moved site would move the hit
    frf_request = FrfRequest(FREQ, outputs, inputs)
    expected = linearise(again, again.drawn, frf_request).values
    assert worst_of_channels(linearise(model, theta, frf_request).values, expected) < 1e-9


def replace_points(machine):
    layout = machine.layout
    bare = replace(
        layout,
        points=(),
        body_of=np.zeros(0, int),
        positions=np.zeros((0, 3)),
        axes=np.zeros((0, 3, 3)),
    )
    return replace(machine, layout=bare)


def test_gains_are_reported_as_not_in_the_mjcf(station, tmp_path):
    model = Model(station, sensor_parts(station)[:1])
    theta = model.drawn.copy()
    theta[1] = 1.02
    _, missing = rebuilt(model, theta, tmp_path)
    assert [str(m) for m in missing] == ["acc17.gain_y (an MJCF site has no gain)"]


def test_a_hit_of_one_direction_is_reported_as_not_in_the_mjcf(station, tmp_path):
    model = Model(station, hammer_parts(station, (Dof("acc11", "+ty"),)))
    _, missing = rebuilt(model, off(model), tmp_path)
    assert [m.name for m in missing] == ["hammer(acc11:ty)"]


@pytest.mark.parametrize("axis", range(3))
def test_a_turned_hit_is_that_of_a_turned_site(station, tmp_path, axis):
    # The same rotation and displacement written to the site, read as hammer only.
    sensor = Model(station, tuple(p for p in sensor_parts(station) if "acc11" in p.location))
    theta = sensor.drawn.copy()
    theta[3:9] = pose = np.array([0.1, -0.2, 0.15, 0.01, 0.02, -0.015])
    again, _ = rebuilt(sensor, theta, tmp_path)
    hit = (Dof.of("acc11", axis),)
    model = Model(station, (*spring_parts(station), *hammer_parts(station, hit)))
    outputs = tuple(Dof.parse(label) for label in ("acc7:+tx", "acc1:-ty", "acc20:+tz"))
    frf_request = FrfRequest(FREQ, outputs, hit)
    expected = linearise(again, again.drawn, frf_request).values
    values = linearise(model, np.concatenate([as_drawn(station).drawn, pose]), frf_request).values
    assert worst_of_channels(values, expected) < 1e-9


def test_a_gain_multiplies_its_channel(station):
    acc7 = tuple(p for p in sensor_parts(station) if "acc7" in p.location)
    model = Model(station, (*acc7, *spring_parts(station)))
    outputs = (Dof("acc7", "+tx"), Dof("acc7", "-ty"), Dof("acc8", "+tx"))
    frf_request = FrfRequest(FREQ, outputs, (Dof("acc11", "+tx"),))
    theta = model.drawn.copy()
    theta[:2] = 1.1, 0.7
    drawn, off_drawing = (
        linearise(model, t, frf_request).values[:, :, 0] for t in (model.drawn, theta)
    )
    np.testing.assert_allclose(off_drawing, drawn * [1.1, 0.7, 1.0], rtol=1e-13)


def test_a_sensor_reads_across_its_axes_symmetrically_and_late(station):
    acc7 = tuple(p for p in sensor_parts(station) if "acc7" in p.location)
    model = Model(station, (*acc7, *spring_parts(station)))
    outputs = (Dof("acc7", "+tx"), Dof("acc7", "-ty"), Dof("acc7", "+tz"), Dof("acc8", "+tx"))
    frf_request = FrfRequest(FREQ, outputs, (Dof("acc11", "+tx"),), window_tau=0.3)
    theta = model.drawn.copy()
    values = {"gain_x": 1.1, "cross_xy": 0.02, "cross_yz": -0.03, "delay_y": 4e-4}
    for name, value in values.items():
        theta[[p.name for p in model.parameters].index(f"acc7.{name}")] = value
    mix = np.array([[1.1, 0.02, 0], [0.02, 1, -0.03], [0, -0.03, 1]])
    sign = np.array([1.0, -1.0, 1.0])
    drawn, off_drawing = (
        linearise(model, t, frf_request).values[:, :, 0] for t in (model.drawn, theta)
    )
    expected = drawn.copy()
    expected[:, :3] = (drawn[:, :3] * sign) @ mix * sign
    expected[:, 1] *= np.exp(-4e-4 * frf_request.laplace)
    np.testing.assert_allclose(off_drawing, expected, rtol=1e-12)
    reasons = {
        edit.name: edit.reason for edit in model_edits(model, theta) if hasattr(edit, "reason")
    }
    assert reasons["acc7.delay_y"] == "an MJCF site has no delay"


def test_a_longer_pendulum_swings_more_slowly(from_text):
    # K = m g l, J = I + m l^2: the centre of mass 0.1 m lower.
    bob = (
        '<body name="bob"><inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>'
        '<joint name="pivot" type="hinge" axis="0 1 0"/><site name="acc1" pos="0 0 -0.5"/></body>'
    )
    machine = from_text(mjcf(bob, gravity="0 0 -9.81"))
    model = Model(machine, body_parts(machine))
    theta = model.drawn.copy()
    theta[9] = -0.1
    matrices = model.matrices(theta)
    assert matrices.stiffness[0, 0] == pytest.approx(3 * 9.81 * 0.6, rel=1e-12)
    assert matrices.mass[0, 0] == pytest.approx(0.1 + 3 * 0.6**2, rel=1e-12)


def test_a_lower_pivot_shortens_the_pendulum(from_text):
    bob = (
        '<body name="bob"><inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>'
        '<joint name="pivot" type="hinge" axis="0 1 0"/><site name="acc1" pos="0 0 -0.5"/></body>'
    )
    machine = from_text(mjcf(bob, gravity="0 0 -9.81"))
    model = Model(machine, joint_parts(machine))
    matrices = model.matrices(np.array([0, 0, -0.2, 0, 0, 0]))
    assert matrices.stiffness[0, 0] == pytest.approx(3 * 9.81 * 0.3, rel=1e-12)
    assert matrices.mass[0, 0] == pytest.approx(0.1 + 3 * 0.3**2, rel=1e-12)


def test_under_gravity_the_rebuilt_machine_differs_by_its_new_sag_only(from_text, tmp_path):
    # The Part keeps the pose at rest: mass + 2 % moves the sag m g / k of 1.3 mm by 26 um.
    machine = from_text(sprung_pendulum())
    model = Model(machine, spring_parts(machine) + body_parts(machine))
    theta = model.drawn.copy()
    heavier = [k for k, p in enumerate(model.parameters) if p.name.endswith(".mass")]
    theta[heavier] *= 1.02
    assert_rebuilt_answers_alike(model, theta, tmp_path, within=1e-4)


def test_names_of_parameters_are_those_of_the_field(station):
    names = [p.name for p in everything(station, (Dof("acc11", "+ty"),)).parameters]
    for name in (
        "ty_tz.stiffness",
        "ty.mass",
        "ty.inertia_xx",
        "ty.com_z",
        "ty.joint_position_x",
        "ty.joint_rotation_y",
        "acc7.gain_x",
        "acc7.rotation_z",
        "acc7.position_y",
        "hammer(acc11:ty).rotation_x",
    ):
        assert names.count(name) == 1
