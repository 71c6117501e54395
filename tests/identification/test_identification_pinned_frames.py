"""The gondola's three frames on pins, against a Ritz calculation with the single frame's modes."""

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from identification.shapes import read_shapes, rigid_modes

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
CENTRE = np.array([0.8, 0.0, 1.2])  # m: where the pins' axes meet


@pytest.fixture(scope="module")
def frames():
    """The asset's module, which stands outside of every package."""
    sys.path.insert(0, str(ASSETS))
    try:
        yield import_module("pinned_frames")
    finally:
        sys.path.remove(str(ASSETS))
        for name in ("pinned_frames", "panels", "equivalent_shell"):
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def joined():
    return read_shapes(ASSETS / "shapes_three_frames.vtu")


def ritz_hz(single, bodies, joints):
    """Frequencies [Hz] in the basis of the single frame's modes and rigid inner frames.

    A motion is (q of the single frame, t and w of each inner one); u = t + w x (r - centre).
    """
    count = len(single)
    size = count + 6 * len(bodies)
    stiffness, mass = np.zeros((size, size)), np.eye(size)
    stiffness[:count, :count] = np.diag((2 * np.pi * single.frequencies) ** 2)
    for number, body in enumerate(bodies):
        first = count + 6 * number
        a, b, c = body.half
        inertia = body.mass * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        mass[first : first + 6, first : first + 6] = np.diag([*[body.mass] * 3, *inertia])

    def motion(body, place):
        row = np.zeros((3, size))
        if body < 0:
            node = int(np.linalg.norm(single.points - place, axis=1).argmin())
            assert np.linalg.norm(single.points[node] - place) < 1e-6
            row[:, :count] = single.vectors[:, node].T
            return row
        first, arm = count + 6 * body, np.asarray(place) - CENTRE
        row[:, first : first + 3] = np.eye(3)
        row[:, first + 3 : first + 6] = np.array([np.cross(unit, arm) for unit in np.eye(3)]).T
        return row

    for joint in joints:
        inside, outside = joint.inside - 1, joint.inside - 2
        apart = motion(inside, joint.place) - motion(outside, joint.place)
        stiffness += apart.T @ np.diag(joint.stiffness) @ apart
    squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)


def test_three_frames_weigh_what_the_document_gives_and_turn_on_their_drives(joined):
    rigid = rigid_modes(joined)
    assert rigid.is_rigid.sum() == 6
    assert rigid.is_mass_normalised
    assert rigid.mass == pytest.approx(800.0, rel=1e-3)
    assert (joined.frequencies[6:8] > 3.0).all()  # two hinges, held by drives
    assert (joined.frequencies[6:8] < 3.6).all()


def test_a_ritz_basis_of_the_single_frames_modes_bounds_the_frequencies_from_above(frames, joined):
    single = read_shapes(ASSETS / "shapes.vtu")
    bodies = (frames.MIDDLE, frames.INNER)
    bounds = ritz_hz(single, bodies, frames.springs(bodies))
    solved = joined.frequencies[6:14]
    assert (bounds[:6] < 0.1).all()
    bounds = bounds[6:14]
    assert (bounds > solved * (1 - 2e-3)).all()
    # A mode that bends the panels at the pins needs more modes of theirs than the basis has.
    excess = np.sort(bounds / solved - 1)
    assert excess[-1] < 0.1
    assert excess[-2] < 0.015


def test_without_pins_the_frames_turn_alone(frames):
    """The drives' springs give a frame on a fixed axis the frequency that was chosen."""
    pitch, roll = (joint for joint in frames.springs() if 0.0 in joint.stiffness)
    for joint, inertia in (
        (pitch, frames.MIDDLE.turning_inertia(1) + frames.INNER.turning_inertia(1)),
        (roll, frames.INNER.turning_inertia(0)),
    ):
        omega = np.sqrt(joint.stiffness[2] * frames.DRIVE_ARM**2 / inertia)
        assert omega / (2 * np.pi) == pytest.approx(3.0)
    corners = frames.INNER.corners - CENTRE
    about_x = frames.INNER.mass / 8 * float((corners[:, 1:] ** 2).sum())
    assert frames.INNER.turning_inertia(0) == pytest.approx(about_x)
