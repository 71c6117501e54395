"""What the rigid modes among finite-element shapes weigh, and which modes are at rest."""

from pathlib import Path

import numpy as np
import pytest

from identification.shapes import compare_mass, read_shapes, rigid_modes
from identification.shapes.fe_file import Shapes
from identification.words import InputError

GONDOLA = Path(__file__).parents[2] / "assets" / "gondola" / "shapes.vtu"


def lumped(random, count=30):
    """Points with masses, and the six rigid modes of them, normalised and mixed at random."""
    points, masses = random.standard_normal((count, 3)), random.uniform(1, 5, count)
    rows = np.zeros((count, 3, 6))
    rows[:, :, :3] = np.eye(3)
    for k, unit in enumerate(np.eye(3)):
        rows[:, :, 3 + k] = np.cross(unit, points)
    whole = np.einsum("pxi,p,pxj->ij", rows, masses, rows)
    mixed = np.linalg.inv(np.linalg.cholesky(whole)).T
    mixed = mixed @ np.linalg.qr(random.standard_normal((6, 6)))[0]
    return points, masses, np.einsum("pxi,im->mpx", rows, mixed)


def test_six_rigid_modes_weigh_a_body_however_they_mix():
    random = np.random.default_rng(7)
    points, masses, vectors = lumped(random)
    bent = random.standard_normal((2, len(points), 3))
    shapes = Shapes(
        "body", points, np.array([[0, 1, 2]]), np.r_[np.zeros(6), 20, 30], np.r_[vectors, bent]
    )
    found = rigid_modes(shapes)
    assert found.is_rigid.tolist() == [True] * 6 + [False] * 2
    assert found.mass == pytest.approx(masses.sum(), rel=1e-9)
    assert found.is_mass_normalised
    centre = masses @ points / masses.sum()
    np.testing.assert_allclose(found.centre, centre, atol=1e-9)
    arms = points - centre
    inertia = sum(
        m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True)
    )
    np.testing.assert_allclose(found.inertia, inertia, atol=1e-7)
    total = float(masses.sum())
    assert compare_mass(found, 1.005 * total, 0.01 * total).agrees
    light = compare_mass(found, 1.21 * total, 0.2 * total)
    assert light.agrees is False
    # Frequencies of the true structure are sqrt(1 / 1.21) = 1 / 1.1 of the model's.
    assert "would change its frequencies by -9.1 %" in light.remark("body")
    other = Shapes("body", points, shapes.triangles, shapes.frequencies[:6], 3.0 * vectors)
    assert rigid_modes(other).mass == pytest.approx(masses.sum() / 9)


def test_a_single_translation_weighs_it_as_the_document_has_it():
    points = np.random.default_rng(8).standard_normal((20, 3))
    shape = np.tile([0.0, 0.05, 0.0], (20, 1))  # 1 / 0.05^2 = 400 kg
    shapes = Shapes("body", points, np.array([[0, 1, 2]]), np.zeros(1), shape[None])
    found = rigid_modes(shapes)
    assert found.by_translation == pytest.approx((400.0,))
    assert found.mass == pytest.approx(400.0)
    turned = np.cross([0.0, 0.0, 1.0], points)
    shapes = Shapes("body", points, np.array([[0, 1, 2]]), np.zeros(1), turned[None])
    unknown = compare_mass(rigid_modes(shapes), 400.0, 4.0)
    assert unknown.agrees is None
    assert "none is a pure translation" in unknown.remark("body")


def test_shapes_that_are_not_normalised_by_mass_are_noticed():
    points, _, vectors = lumped(np.random.default_rng(9))
    own = vectors / np.abs(vectors).max(axis=(1, 2), keepdims=True)
    shapes = Shapes("body", points, np.array([[0, 1, 2]]), np.zeros(6), own)
    assert not rigid_modes(shapes).is_mass_normalised


def test_shapes_of_largest_displacement_one_weigh_nothing_that_could_be_told():
    """Pure translations and turns, whose M_6 is that of a body with all mass at its ends."""
    points, _, _ = lumped(np.random.default_rng(9))
    arms = points - points.mean(axis=0)
    pure = [np.tile(unit, (len(points), 1)) for unit in np.eye(3)]
    pure += [np.cross(unit, arms) for unit in np.eye(3)]
    own = np.array([one / np.linalg.norm(one, axis=1).max() for one in pure])
    shapes = Shapes("body", points, np.array([[0, 1, 2]]), np.zeros(6), own)
    found = rigid_modes(shapes)
    assert not found.is_mass_normalised
    unknown = compare_mass(found, found.mass, 1.0)
    assert unknown.agrees is None
    assert "not normalised by mass" in unknown.remark("body")


def plain(frequencies, rigid):
    """Modes of some frequencies, rigid or not."""
    random = np.random.default_rng(10)
    points, _, vectors = lumped(random)
    bent = random.standard_normal((len(frequencies), *points.shape))
    shapes = [vectors[k % 6] if own else bent[k] for k, own in enumerate(rigid)]
    return Shapes("s.vtu", points, np.array([[0, 1, 2]]), np.array(frequencies), np.array(shapes))


def test_a_rigid_shape_that_mounts_hold_is_a_mode_like_any_other():
    on_mounts = rigid_modes(plain([18.0, 24.0, 29.0, 38.0, 45.0], [True] * 3 + [False] * 2))
    assert on_mounts.is_rigid.tolist() == [True] * 3 + [False] * 2
    assert on_mounts.supported.all()
    free = rigid_modes(plain([-1e-4, 0.0, 2e-3, 38.0, 45.0], [True] * 3 + [False] * 2))
    assert free.supported.tolist() == [False] * 3 + [True] * 2
    # A mechanism is at rest, though it deforms.
    hinged = rigid_modes(plain([-2e-3, 0.0, 1e-3, 38.0], [False, True, True, False]))
    assert hinged.supported.tolist() == [False] * 3 + [True]


def test_frequencies_in_another_order_than_the_shapes_are_refused():
    with pytest.raises(InputError, match=r"deforms is at 0 Hz, .* rigid at 38 Hz: .* do not fit"):
        rigid_modes(plain([0.0, 0.0, 38.0, 45.0], [False, False, True, True]))


def test_the_gondolas_shapes_weigh_what_its_panels_do():
    shapes = read_shapes(GONDOLA)
    found = rigid_modes(shapes)
    assert found.is_rigid.tolist() == [True] * 6 + [False] * (len(shapes) - 6)
    assert found.is_mass_normalised
    assert found.mass == pytest.approx(264.1, rel=1e-3)  # make_gondola.py prints what was drawn
    assert abs(found.centre[1]) < 1e-4  # it is symmetric
    assert 25 < shapes.frequencies[6] < 40
    assert (shapes.frequencies[6:12] < 110).all()
