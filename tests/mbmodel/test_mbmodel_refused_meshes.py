"""Meshes that bound no solid, broken files and wrong arguments are refused by name."""

import struct

import meshio
import numpy as np
import pytest
from mesh_examples import BOX_TETRAHEDRA, box, together, write_as

from identification.words import InputError
from mbmodel.meshes.mass_properties import (
    read_mass_properties,
    surface_mass_properties,
    volume_mass_properties,
)

DENSITY = 2800.0
CENTRE = (1.0, -2.0, 3.0)
CUBOID = box((0.3, 0.5, 0.7), CENTRE)


def flip_faces(triangles, which):
    changed = np.array(triangles)
    changed[which] = changed[which][..., ::-1]
    return changed


POINTS, TRIANGLES = CUBOID
INNER = box((0.1, 0.1, 0.1), CENTRE)
OUTER = box((0.1, 0.1, 0.1), (2.0, 0, 0))
REFUSED = {
    "open": ((POINTS, TRIANGLES[1:]), ["3 of 18 edges", "one face only", "close it"]),
    "one flipped face": ((POINTS, flip_faces(TRIANGLES, 4)), ["3 of 18 edges", "turned against"]),
    "inside out": ((POINTS, TRIANGLES[:, ::-1]), ["inside out", "reverse its faces"]),
    "a loose face inside": (
        (np.vstack([POINTS, [CENTRE]]), np.vstack([TRIANGLES, [0, 6, 8]])),
        ["3 of 21 edges", "one face only"],
    ),
    "a wall inside": (
        (POINTS, np.vstack([TRIANGLES, [0, 2, 6], [0, 6, 4]])),
        ["4 of 19 edges", "three or more faces", "remove the faces inside"],
    ),
    "flat": ((POINTS * [1, 1, 0], TRIANGLES), ["no volume"]),
    "twice": (together(CUBOID, CUBOID), ["more than once", "remove the copies"]),
    "a part inside out": (
        together(CUBOID, (OUTER[0], OUTER[1][:, ::-1])),
        ["part near (2, 0, 0)", "inside out"],
    ),
    "a part within": (together(CUBOID, INNER), ["lies inside another", "cavity"]),
    "empty": ((POINTS, np.empty((0, 3), int)), ["no cells"]),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_surface_that_bounds_no_solid_is_refused(case):
    shape, words = REFUSED[case]
    with pytest.raises(InputError) as caught:
        surface_mass_properties(*shape, DENSITY)
    for word in words:
        assert word in str(caught.value)


def test_tetrahedra_that_are_inside_out_flat_or_overlap_are_refused():
    with pytest.raises(InputError, match="1 of 5 tetrahedra are flat or inside out"):
        volume_mass_properties(
            POINTS, [*BOX_TETRAHEDRA[:2], [6, 1, 4, 5], *BOX_TETRAHEDRA[3:]], DENSITY
        )
    with pytest.raises(InputError, match="5 of 5"):
        volume_mass_properties(POINTS * [1, 1, 0], BOX_TETRAHEDRA, DENSITY)
    with pytest.raises(InputError, match="overlap"):
        volume_mass_properties(POINTS, np.vstack([BOX_TETRAHEDRA, BOX_TETRAHEDRA[:1]]), DENSITY)
    with pytest.raises(InputError, match="no cells"):
        volume_mass_properties(POINTS, np.empty((0, 4), int), DENSITY)


@pytest.mark.parametrize("density", [0.0, -2800.0, np.nan, np.inf])
def test_a_density_that_is_not_positive_is_refused(density):
    with pytest.raises(InputError, match="density"):
        surface_mass_properties(*CUBOID, density)
    with pytest.raises(InputError, match="density"):
        volume_mass_properties(POINTS, BOX_TETRAHEDRA, density)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan])
def test_a_scale_that_is_not_positive_is_refused(tmp_path, scale):
    path = write_as(tmp_path, "stl", POINTS, {"triangle": TRIANGLES})
    with pytest.raises(InputError, match="metres per unit"):
        read_mass_properties(path, DENSITY, scale=scale)


def test_arrays_that_are_no_mesh_are_a_mistake_of_the_program():
    with pytest.raises(ValueError, match="not finite"):
        surface_mass_properties(POINTS * np.nan, TRIANGLES, DENSITY)
    with pytest.raises(ValueError, match="does not exist"):
        surface_mass_properties(POINTS, TRIANGLES + 1, DENSITY)


def binary_stl(corners):
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(c), 0) for c in corners)
    return bytes(80) + struct.pack("<I", len(corners)) + facets


BAD_FILES = {
    "empty.stl": (b"", ["no faces", "export"]),
    "nothing.stl": (binary_stl([]), ["no faces"]),
    "short.stl": (binary_stl(POINTS[TRIANGLES])[:-30], ["short.stl"]),
    "nan.stl": (binary_stl([[[0, 0, 0], [1, 0, np.nan], [0, 1, 0]]]), ["are not finite"]),
    "open.stl": (binary_stl(POINTS[TRIANGLES[1:]]), ["one face only"]),
    "word.obj": (b"v 0 0 zero\n", ["cannot be read as OBJ"]),
    "flat.obj": (b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", ["three coordinates"]),
    "wrong.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", ["does not exist"]),
    "points.obj": (b"v 0 0 0\n", ["no faces"]),
    "text.vtu": (b"hello", ["cannot be read as VTU"]),
    "other.vtu": (b"<page/>", ["cannot be read as VTU"]),
    "other.msh": (b"hello\n", ["cannot be read as MSH"]),
    "part.step": (b"ISO-10303-21;", [".stl, .obj, .msh or .vtu"]),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_broken_file_is_refused_by_name_and_in_silence(tmp_path, capfd, name):
    content, words = BAD_FILES[name]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_mass_properties(path, DENSITY)
    for word in (str(path), *words):
        assert word in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.stl does not exist"):
        read_mass_properties(tmp_path / "none.stl", DENSITY)


def test_curved_cells_are_refused_by_their_kind(tmp_path):
    path = tmp_path / "curved.vtu"
    points = np.vstack([POINTS, POINTS])
    meshio.Mesh(points, {"tetra10": np.arange(10)[None]}).write(path)
    with pytest.raises(InputError, match="cells of kind tetra10"):
        read_mass_properties(path, DENSITY)
