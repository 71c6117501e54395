"""OBJ files as programs write them, and broken ones."""

from types import SimpleNamespace

import meshio
import numpy as np
import pytest

from identification.words import InputError
from mbmodel.meshes.files import read_mesh
from mbmodel.meshes.mass_properties import read_mass_properties

POINTS = [(x, y, z) for x in (0.0, 0.2) for y in (0.0, 0.1) for z in (0.0, 0.05)]
FACES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
DENSITY = 2700.0


def obj(corner=lambda point, place: f"{point}", *, faces=FACES, extra=""):
    places = iter(range(1, 1000))
    lines = [f"v {x} {y} {z}" for x, y, z in POINTS]
    lines += ["f " + " ".join(corner(point, next(places)) for point in face) for face in faces]
    return extra + "\n".join(lines) + "\n"


TEXTURES = "".join(f"vt {k / 24} 0\nvn 0 0 1\n" for k in range(24))  # more than points
TEXTS = {
    "plain": obj(),
    "textures": obj(lambda point, place: f"{point}/{place}", extra=TEXTURES),
    "textures and normals": obj(lambda point, place: f"{point}/{place}/{place}", extra=TEXTURES),
    "normals": obj(lambda point, place: f"{point}//{place}", extra=TEXTURES),
    "backwards": obj(lambda point, place: f"{point - 9}"),
    "groups": obj(extra="# x\nmtllib a.mtl\no box\ng side\nusemtl steel\ns off\n"),
    "halves": obj(faces=[half for a, b, c, d in FACES for half in ((a, b, c), (a, c, d))]),
    "line ends": obj().replace("\n", "\r\n"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_box_weighs_alike_however_it_is_written(tmp_path, name):
    path = tmp_path / "box.obj"
    path.write_text(TEXTS[name], newline="")
    box = read_mass_properties(path, DENSITY)
    assert box.mass == pytest.approx(DENSITY * 0.2 * 0.1 * 0.05, rel=1e-12)
    np.testing.assert_allclose(box.centre, [0.1, 0.05, 0.025], rtol=1e-12)


@pytest.mark.parametrize(
    "line", ["f", "f 1 2", "f 1 2 x", "f 0 1 2", "f 1 2 -9", "v 1 2", "v 1 2 x", "f 1.5 2 3"]
)
def test_a_line_that_is_neither_point_nor_face_is_named(tmp_path, line):
    path = tmp_path / "box.obj"
    path.write_text(obj() + line + "\n")
    with pytest.raises(InputError, match=r"box\.obj: cannot be read as OBJ \(line 15 is"):
        read_mesh(path)


@pytest.mark.parametrize("line", ["f 1 2 99", "v 1 2 nan", "v 1 2 1e300"])
def test_points_that_do_not_exist_or_are_no_numbers_are_refused(tmp_path, line):
    path = tmp_path / "box.obj"
    path.write_text(obj() + line + "\n")
    with pytest.raises(InputError, match="export the mesh again"):
        read_mesh(path)


def test_a_cell_with_too_few_corners_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "box.msh"
    path.write_text("")
    # As a damaged binary file of gmsh gives it.
    block = SimpleNamespace(type="hexahedron", dim=3, data=np.arange(7)[None])
    mesh = SimpleNamespace(points=np.array(POINTS), cells=[block])
    monkeypatch.setattr(meshio, "read", lambda *_, **__: mesh)
    with pytest.raises(InputError, match=r"box\.msh: a hexahedron has other than 8 corners"):
        read_mesh(path)
