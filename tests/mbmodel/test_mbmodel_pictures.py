"""Pictures of a machine: camera, motion of bodies in a mode, MuJoCo's renderer without a window."""

import numpy as np
import pytest
from small_machine import MJCF

from mbmodel import load_machine, machine_geometry
from mbmodel.geometry import viewer
from mbmodel.geometry.camera import Camera, frame_camera
from mbmodel.geometry.motion import WORLD, cycle, geometry_points, motion_scale, move_points
from mbmodel.geometry.offscreen import render_machine

BALL = """<mujoco><asset>
  <texture name="sky" type="skybox" builtin="flat" rgb1="0 0 1" width="8" height="48"/>
</asset><worldbody>
  <geom type="plane" size="5 5 0.1" pos="0 0 -0.3" contype="0" conaffinity="0"/>
  <body name="ball" pos="0.3 -0.2 0.4"><joint type="slide" axis="0 0 1" stiffness="1e6"/>
    <geom type="sphere" size="0.05" mass="1" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def ball(tmp_path):
    (tmp_path / "ball.xml").write_text(BALL, encoding="utf-8")
    return load_machine(tmp_path / "ball.xml")


def centre_of(shown):
    rows, columns = np.nonzero(shown)
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])


def test_the_camera_projects_as_mujoco_renders(ball):
    camera = Camera(np.array([0.1, 0.1, 0.2]), 2.0, 110.0, -30.0)
    shifts = np.zeros((3, 1, 6))
    shifts[1, 0, 0], shifts[2, 0, 2] = 0.3, -0.25
    pictures = render_machine(ball, machine_geometry(ball), shifts, camera, (640, 480))
    if pictures is None:
        pytest.skip("MuJoCo has no OpenGL here")
    for shift, (colours, shown) in zip(shifts, pictures, strict=True):
        assert colours[shown].mean(axis=0)[0] > 3 * colours[shown].mean(axis=0)[1]  # red
        place = ball.layout.centres + shift[:, :3]
        pixels, depth = camera.project(place, 640, 480)
        # The contour of a ball of radius r is seen 1 / (1 - (r / d)^2) further out.
        off_axis = (pixels[0] - [320, 240]) / (1 - (0.05 / depth[0]) ** 2) + [320, 240]
        np.testing.assert_allclose(centre_of(shown), off_axis, atol=0.7)


def test_a_body_without_a_geom_is_a_box(tmp_path):
    (tmp_path / "pair.xml").write_text(MJCF, encoding="utf-8")
    machine = load_machine(tmp_path / "pair.xml")
    geometry = machine_geometry(machine)
    points, _ = geometry_points(geometry, machine.layout.bodies)
    camera = frame_camera(points, 4 / 3)
    pictures = render_machine(machine, geometry, np.zeros((1, 2, 6)), camera, (320, 240))
    if pictures is None:
        pytest.skip("MuJoCo has no OpenGL here")
    ((_, shown),) = pictures
    pixels = camera.project(machine.layout.centres, 320, 240)[0].astype(int)
    assert all(shown[row, column] for column, row in pixels)
    assert shown.mean() > 0.1


def test_without_opengl_nothing_is_rendered(ball, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    camera = Camera(np.zeros(3), 2.0)
    assert (
        render_machine(ball, machine_geometry(ball), np.zeros((1, 1, 6)), camera, (64, 48)) is None
    )
    monkeypatch.setenv("MUJOCO_GL", "no_such_library")
    assert (
        render_machine(ball, machine_geometry(ball), np.zeros((1, 1, 6)), camera, (64, 48)) is None
    )


def test_the_framed_machine_fills_the_picture_and_stays_inside():
    random = np.random.default_rng(2)
    points = random.uniform(-1, 1, (200, 3)) * [3.0, 1.0, 0.4] + [5.0, -2.0, 1.0]
    pixels, depth = frame_camera(points, 4 / 3).project(points, 800, 600)
    assert (depth > 0).all()
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert (low >= 0).all()
    assert (high <= [800, 600]).all()
    np.testing.assert_allclose((low + high) / 2, [400, 300], atol=8)
    assert max((high - low) / [800, 600]) > 0.85


def test_a_body_moves_as_a_solid_about_its_centre():
    random = np.random.default_rng(3)
    points, centres = random.normal(size=(12, 3)), random.normal(size=(2, 3))
    stages = np.array([0, 1, WORLD] * 4)
    motion = random.normal(size=(2, 6)) * 0.3
    moved = move_points(points, stages, centres, motion)
    np.testing.assert_array_equal(moved[stages == WORLD], points[stages == WORLD])
    for body in (0, 1):
        before, after = points[stages == body], moved[stages == body]
        np.testing.assert_allclose(
            np.linalg.norm(after[:, None] - after, axis=2),
            np.linalg.norm(before[:, None] - before, axis=2),
        )
    small = 1e-6 * motion
    shift = (move_points(points, stages, centres, small) - points)[stages == 1]
    expected = small[1, :3] + np.cross(small[1, 3:], points[stages == 1] - centres[1])
    np.testing.assert_allclose(shift, expected, atol=1e-11)


def test_the_largest_motion_of_a_cycle_is_that_of_the_scale():
    random = np.random.default_rng(4)
    points, centres = random.normal(size=(30, 3)), np.zeros((1, 3))
    stages = np.zeros(30, np.intp)
    shape = (random.normal(size=(1, 6)) + 0.2j * random.normal(size=(1, 6))) * 1e-4
    factor = motion_scale(points, stages, centres, shape, 0.01)
    moves = [
        np.linalg.norm(move_points(points, stages, centres, motion) - points, axis=1).max()
        for motion in cycle(factor * shape, 60)
    ]
    assert 0.008 < max(moves) < 0.0101
    assert motion_scale(points, stages, centres, np.zeros((1, 6)), 0.01) == 0.0


def test_points_of_a_geometry_move_with_their_body(tmp_path):
    (tmp_path / "pair.xml").write_text(MJCF, encoding="utf-8")
    machine = load_machine(tmp_path / "pair.xml")
    geometry = machine_geometry(machine)
    points, stages = geometry_points(geometry, machine.layout.bodies)
    count = sum(len(surface.vertices) for surface in geometry.surfaces)
    assert len(points) == len(stages) == count + sum(len(line.points) for line in geometry.lines)
    first = geometry.surfaces[0]
    assert machine.layout.bodies[stages[0]] == first.stage


class FakeWindow:
    """Stands for the handle of MuJoCo's viewer, which is closed after some pictures."""

    def __init__(self, data, pictures):
        self.data, self.left, self.seen = data, pictures, []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.left = 0

    def is_running(self):
        return self.left > 0

    def lock(self):
        return self

    def sync(self):
        self.left = self.left - 1
        self.seen.append((self.data.qpos.copy(), self.data.geom_xpos.copy()))


def test_the_viewer_shows_the_joints_move_in_the_mode(ball, monkeypatch):
    windows = []

    class Module:
        @staticmethod
        def launch_passive(model, data):
            windows.append(FakeWindow(data, 12))
            return windows[-1]

    monkeypatch.setattr(viewer, "import_module", lambda _: Module)
    monkeypatch.setattr(viewer, "_CYCLE_S", 0.1)
    monkeypatch.setattr(FakeWindow, "__exit__", lambda *_: None)
    viewer.open_viewer(ball, np.array([0.02 + 0j]))
    joint = np.array([qpos[0] for qpos, _ in windows[0].seen])
    height = np.array([places[1, 2] for _, places in windows[0].seen])
    assert len(joint) == 12
    assert np.ptp(joint) > 0.02
    assert np.abs(joint).max() < 0.021
    np.testing.assert_allclose(height - joint, (height - joint)[0])


def test_a_viewer_that_fails_ends_in_a_sentence(ball, monkeypatch):
    def fail(_):
        raise RuntimeError("no\nwindow")

    monkeypatch.setattr(viewer, "import_module", fail)
    with pytest.raises(Exception, match=r"cannot open a window \(no window\): write a picture"):
        viewer.open_viewer(ball, np.zeros(1))
    monkeypatch.setenv("DISPLAY", ":77")
    with pytest.raises(Exception, match="there is no display"):
        viewer.refuse_missing_display()
