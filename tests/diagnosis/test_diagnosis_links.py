"""Links between bodies, or from the ground to a body: springs and dampers of any axes."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from diagnosis import EFFECTS, Scene
from diagnosis.effects.passive_matrix import build_passive, slope_passive
from mbmodel import parent_bodies, transport
from tests.helpers.drawn import drawn


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("drawn"), 72_001, lines=161)
    return Scene(session, session.model.drawn * 1.1)


def test_a_link_may_begin_as_stiff_as_the_slides_of_its_upper_body_are_drawn(scene):
    springs = scene.model.machine.springs
    for link in EFFECTS["parallel_path"](scene):
        upper = link.location.rpartition("-")[2]
        of_slides = [
            spring.stiffness
            for spring in springs
            if spring.location == f"joint:{upper}" and not spring.angular
        ]
        (begun,) = link.otherwise
        (part,) = link.parts
        values = {p.name: begun.get(p.name, 0.0) for p in part.parameters}
        said = np.array(link.state(values)["stiffness"])
        np.testing.assert_allclose(said, np.median(of_slides))


def test_a_link_states_what_it_has_in_each_direction_or_in_its_own(scene):
    link = next(EFFECTS["parallel_path"](scene))
    (part,) = link.parts
    stiffness, damping = 3.0e5, 120.0
    slopes = part.derivatives(np.zeros(12))[0].core
    units = slopes[0, 0, 0, 0], slopes[3, 1, 0, 0]
    names = [parameter.name for parameter in part.parameters]
    alike = np.zeros(12)
    alike[:3], alike[3:6] = stiffness / units[0], damping / units[1]
    said = link.state(dict(zip(names, alike, strict=True)))
    np.testing.assert_allclose(said["stiffness"], stiffness)
    np.testing.assert_allclose(said["damping"], damping)
    # A strut, wherever it is, gives k n n' at its point: y is turned towards x and z.
    axis = np.array([0.6, -0.64, 0.48])
    strut = np.zeros(12)
    strut[[1, 4]] = axis[1] ** 2 * np.array([stiffness / units[0], damping / units[1]])
    strut[6], strut[8] = axis[0] / axis[1], axis[2] / axis[1]
    strut[9:] = 1.0, -2.0, 0.5  # tenths of a metre from halfway
    said = link.state(dict(zip(names, strut, strict=True)))
    np.testing.assert_allclose(said["stiffness"], stiffness * axis**2)
    np.testing.assert_allclose(said["damping"], damping * axis**2)
    (change,) = part.finite(strut)
    layout = scene.session.model.machine.layout
    low, high = (layout.bodies.index(name) for name in link.location[5:].split("-"))
    centres = layout.centres
    point = (centres[low] + centres[high]) / 2 + [0.1, -0.2, 0.05]
    np.testing.assert_allclose(said["position"], point)
    row = np.zeros(6 * len(layout.bodies))
    for body, sign in ((high, 1.0), (low, -1.0)):
        row[6 * body : 6 * body + 3] = sign * axis
        row[6 * body + 3 : 6 * body + 6] = sign * np.cross(point - centres[body], axis)
    for power, size in ((0, stiffness), (1, damping)):
        whole = change.left @ change.core[power] @ change.right.T
        np.testing.assert_allclose(whole, size * np.outer(row, row), atol=1e-9 * size)


def test_a_link_is_any_passive_matrix_and_no_other():
    """Every K without negative eigenvalues, of any rank, is fitted from a start along the axes."""
    random = np.random.default_rng(5)
    upper = np.triu_indices(3)
    lower, higher = [0.0] * 3 + [-1.0] * 3, [np.inf] * 3 + [1.0] * 3
    for number in range(30):
        root = random.standard_normal((3, 1 + number % 3)) * 10.0 ** random.uniform(-2, 0)
        wanted = root @ root.T / np.trace(root @ root.T)
        start = np.append(np.diag(wanted), np.zeros(3))
        fit = least_squares(
            lambda x, wanted=wanted: (build_passive(x[:3], x[3:]) - wanted)[upper],
            start, bounds=(lower, higher), xtol=1e-14, ftol=1e-14, gtol=1e-14,
        )  # fmt: skip
        assert np.abs(fit.fun).max() < 1e-6
        any_other = np.append(random.uniform(0, 1, 3), random.uniform(-1, 1, 3))
        matrix = build_passive(any_other[:3], any_other[3:])
        assert np.linalg.eigvalsh(matrix).min() > -1e-12


def test_the_slopes_of_a_passive_matrix_are_those_of_differences():
    random = np.random.default_rng(6)
    theta, step = np.append(random.uniform(0, 1, 3), random.uniform(-1, 1, 3)), 1e-6
    slopes = slope_passive(theta[:3], theta[3:])
    for number, unit in enumerate(step * np.eye(6)):
        (high, low) = (build_passive(x[:3], x[3:]) for x in (theta + unit, theta - unit))
        np.testing.assert_allclose(slopes[number], (high - low) / (2 * step), atol=1e-9)


def test_a_link_to_the_ground_pulls_at_its_point_of_the_body_alone(scene):
    machine = scene.model.machine
    links = [
        link for link in EFFECTS["parallel_path"](scene) if link.location.startswith("pair:world-")
    ]
    linked = {link.location.removeprefix("pair:world-") for link in links}
    parents = parent_bodies(machine)
    assert linked == {body for body in machine.layout.bodies if parents[body] is not None}
    link = links[-1]
    assert link.movable.bodies == ("world", link.location.removeprefix("pair:world-"))
    (part,) = link.parts
    theta = np.zeros(12)
    theta[:3], theta[9:] = 2.0, (1.0, -2.0, 0.5)
    values = link.movable.read(dict(zip((p.name for p in part.parameters), theta, strict=True)))
    (change,) = part.finite(theta)
    matrix = change.left @ change.core[0] @ change.right.T
    number = machine.layout.bodies.index(link.movable.bodies[1])
    motion = np.zeros((3, 6 * len(machine.layout.bodies)))
    arm = transport(values["point"] - machine.layout.centres[number])
    motion[:, 6 * number : 6 * number + 6] = arm[:3]
    expected = motion.T @ np.diag(values["sizes"][0]) @ motion
    np.testing.assert_allclose(matrix, expected, atol=1e-9 * np.abs(expected).max())
