"""Modes of a model: shapes against FRFs, names of motions at rest, energy shares."""

from dataclasses import replace

import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, random_tree, taut, worst_of_channels
from test_mbmodel_slopes import with_follower_forces

from identification.words import Dof
from mbmodel import (
    FrfRequest,
    as_drawn,
    energy_shares,
    linearise,
    model_modes,
    modes_of_matrices,
    shapes_at,
)

BAR = '<inertial pos="0.1 0.2 -0.1" mass="4" diaginertia="0.3 0.4 0.5"/>'


def names_of(machine):
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    return modes, [name for name in modes.names if name]


@pytest.mark.parametrize("seed", range(4))
def test_modes_add_up_to_the_receptance(from_text, seed):
    # H = sum_r phi phi' / (a_r (s - s_r)) + conj., a_r = phi' (2 s_r M + C) phi (seed, eq. 3.5).
    model = as_drawn(from_text(random_tree(seed)))
    modes = model_modes(model, model.drawn)
    outputs = tuple(Dof.of(body, axis) for body in model.machine.layout.bodies for axis in range(6))
    frf_request = FrfRequest(np.linspace(1, 300, 40), outputs, outputs[:2], "receptance")
    matrices = model.matrices(model.drawn)
    shapes = shapes_at(model, model.drawn, modes, outputs)
    total = np.zeros((40, len(outputs), 2), complex)
    for pole, shape, readout in zip(modes.poles, modes.shapes.T, shapes.T, strict=True):
        modal_a = shape @ (2 * pole * matrices.mass + matrices.damping) @ shape
        residue = np.outer(readout, readout[:2]) / modal_a
        total += residue / (frf_request.laplace - pole)[:, None, None]
        if pole.imag > 0:
            total += residue.conj() / (frf_request.laplace - pole.conj())[:, None, None]
    assert worst_of_channels(total, linearise(model, model.drawn, frf_request).values) < 1e-8


def test_shapes_solve_the_eigenproblem_and_have_unit_modal_mass(station_model, away):
    matrices = station_model.matrices(away)
    modes = modes_of_matrices(matrices)
    for pole, shape in zip(modes.poles, modes.shapes.T, strict=True):
        force = matrices.dynamic_stiffness(pole) @ shape
        size = np.abs(matrices.stiffness) @ np.abs(shape)
        assert (np.abs(force) <= 1e-9 * size.max()).all()
        assert (shape.conj() @ matrices.mass @ shape).real == pytest.approx(1.0, rel=1e-12)
        assert abs((shape @ matrices.mass @ shape).imag) < 1e-12


def test_modes_without_symmetry_solve_their_eigenproblem_too(station):
    model = as_drawn(with_follower_forces(station))
    matrices = model.matrices(model.drawn)
    modes = modes_of_matrices(matrices)
    assert len(modes.poles) >= 36
    for pole, shape in zip(modes.poles, modes.shapes.T, strict=True):
        force = matrices.dynamic_stiffness(pole) @ shape
        assert (np.abs(force) <= 1e-8 * (np.abs(matrices.stiffness) @ np.abs(shape)).max()).all()


def test_a_free_body_has_six_rigid_motions_by_name(from_text):
    modes, names = names_of(from_text(mjcf(f'<body name="a"><freejoint/>{BAR}</body>')))
    assert names == ["rigid tx", "rigid ty", "rigid tz", "rigid rx", "rigid ry", "rigid rz"]
    np.testing.assert_array_equal(modes.poles, 0)


def test_a_free_pair_keeps_its_rigid_motions_and_has_its_own_modes_beside(from_text):
    joints = "".join(
        f'<joint name="j{k}" type="{kind}" axis="{axis}" stiffness="{1e5 * (k + 1)}" damping="4"/>'
        for k, (kind, axis) in enumerate(
            (kind, axis) for kind in ("slide", "hinge") for axis in ("1 0 0", "0 1 0", "0 0 1")
        )
    )
    upper = f'<body name="b" pos="0.2 0.1 0.5">{BAR}{joints}</body>'
    machine = from_text(mjcf(f'<body name="a"><freejoint/>{BAR}{upper}</body>'))
    modes, names = names_of(machine)
    assert names == ["rigid tx", "rigid ty", "rigid tz", "rigid rx", "rigid ry", "rigid rz"]
    assert len(modes.poles) == 12
    assert (modes.poles[6:].imag > 10).all()
    model = as_drawn(machine)
    outputs = (Dof("a", "+tx"), Dof("b", "+tx"), Dof("a", "+rx"), Dof("b", "+rx"))
    shapes = shapes_at(model, model.drawn, modes, outputs)
    assert shapes[0, 0] == pytest.approx(shapes[1, 0], rel=1e-9)  # rigid tx: both alike
    np.testing.assert_allclose(shapes[2:, 0], 0, atol=1e-12)
    assert shapes[2, 3] == pytest.approx(shapes[3, 3], rel=1e-9)


def test_a_free_drive_is_named_after_its_joint(from_text):
    hinge = '<joint name="drive" type="hinge" axis="0 0 1" pos="0.1 0.2 0"/>'
    drive = f'<body name="b">{BAR}{hinge}</body>'
    machine = from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0).replace("</body>", drive + "</body>")))
    modes, names = names_of(machine)
    assert names == ["free drive"]
    assert len(modes.poles) == 2


def test_a_damped_free_drive_has_a_pole_at_rest_and_one_that_creeps(from_text):
    # m x'' + c x' = 0: s = 0 and s = -c / m.
    machine = from_text(mjcf(mass_on_spring(4.0, 0, 11.0)))
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    np.testing.assert_allclose(modes.poles, [0, -11 / 4], atol=1e-12)


def test_a_differential_is_named_by_its_coordinates(from_text):
    # Two masses whose sum alone is held: the difference is free.
    text = mass_on_spring(2, 0, 0, name="a") + mass_on_spring(2, 0, 0, name="b", node=2)
    tendon = (
        '<tendon><fixed name="t" stiffness="7e3" damping="11"><joint joint="a_j" coef="1"/>'
        '<joint joint="b_j" coef="1"/></fixed></tendon>'
    )
    _, names = names_of(from_text(mjcf(text).replace("</mujoco>", tendon + "</mujoco>")))
    assert names == ["free a_j with b_j"]


def shares(model):
    modes = model_modes(model, model.drawn)
    return modes, energy_shares(model, model.drawn, modes)


@pytest.mark.parametrize("case", ["station", "skew", "taut"])
def test_shares_of_every_mode_add_up_to_one(station_model, from_text, case):
    text = taut(0.001)[0] if case == "taut" else random_tree(3)
    model = station_model if case == "station" else as_drawn(from_text(text))
    modes, part = shares(model)
    assert part.strain.shape == (len(part.springs), len(modes.poles))
    for table in (part.strain, part.kinetic):
        np.testing.assert_allclose(table.sum(axis=0), 1.0, rtol=1e-9)
    lossy = part.dissipation.any(axis=0)
    np.testing.assert_allclose(part.dissipation[:, lossy].sum(axis=0), 1.0, rtol=1e-9)
    for summed in (part.by_stage(part.strain), part.by_body()):
        np.testing.assert_allclose(sum(summed.values()), 1.0, rtol=1e-9)


def test_the_strain_share_is_twice_the_sensitivity_of_the_frequency(station_model):
    # Lightly damped: every damper divided by 1e4.
    theta = station_model.drawn.copy()
    theta[[p.name.endswith("damping") for p in station_model.parameters]] *= 1e-4
    modes = model_modes(station_model, theta)
    part = energy_shares(station_model, theta, modes)
    for k, name in ((0, "granite_bottom_rx"), (17, "ty_rz"), (33, "hexapod_rx")):
        index = [p.name for p in station_model.parameters].index(f"{name}.stiffness")
        step = 1e-4 * theta[index] * np.eye(72)[index]
        up, down = (model_modes(station_model, theta + way * step).freq_hz for way in (1, -1))
        slope = np.log(up / down) / 2e-4
        spring = part.springs.index(name)
        np.testing.assert_allclose(part.strain[spring], 2 * slope, atol=2e-6)
        assert part.strain[spring].max() > 0.05, k


def test_the_dissipation_share_is_the_dampers_part_of_the_damping_ratio(station_model):
    theta = station_model.drawn.copy()
    dampers = [k for k, p in enumerate(station_model.parameters) if p.name.endswith("damping")]
    theta[dampers] *= 1e-4
    modes = model_modes(station_model, theta)
    part = energy_shares(station_model, theta, modes)
    name = "tilt_tz"
    without = theta.copy()
    without[[p.name for p in station_model.parameters].index(f"{name}.damping")] = 0.0
    lost = 1 - model_modes(station_model, without).damping / modes.damping
    row = part.dissipation[part.springs.index(name)]
    np.testing.assert_allclose(row, lost, atol=1e-5)
    assert row.max() > 0.05


def test_one_mass_keeps_all_its_energy_in_its_spring_and_direction(from_text):
    _, part = shares(as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0)))))
    np.testing.assert_allclose(part.strain, [[1.0]])
    np.testing.assert_allclose(part.dissipation, [[1.0]])
    assert part.kinetic[part.motions.index("a:tz"), 0] == pytest.approx(1.0)


def test_a_pendulums_strain_is_gravitys(from_text):
    bob = (
        '<body name="bob"><inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>'
        '<joint name="pivot" type="hinge" axis="0 1 0" damping="0.1"/></body>'
    )
    _, part = shares(as_drawn(from_text(mjcf(bob, gravity="0 0 -9.81"))))
    assert part.strain[part.springs.index("gravity"), 0] == pytest.approx(1.0)


def test_forces_of_no_part_are_listed_as_other(station):
    stiff = replace(station, remaining_stiffness=1e8 * np.eye(36))
    _, part = shares(as_drawn(stiff))
    assert part.springs[-1] == "other"
    assert part.strain[-1].max() > 0.5


def test_a_motion_at_rest_has_no_strain_to_share(from_text):
    upper = mass_on_spring(3.0, 9e4, 15.0, name="b", node=2)
    free = mass_on_spring(7.0, 0, 0).replace("</body>", upper + "</body>")
    modes, part = shares(as_drawn(from_text(mjcf(free))))
    assert modes.names[0] == "rigid tz"
    np.testing.assert_array_equal(part.strain[:, 0], 0)
    assert part.kinetic[:, 0].sum() == pytest.approx(1.0)
