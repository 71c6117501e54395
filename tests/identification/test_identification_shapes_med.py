"""MED files of shapes with fields on cells, with profiles, and damaged ones."""

import h5py
import meshio
import numpy as np
import pytest

from identification.shapes import read_shapes
from identification.words import InputError

FREQUENCIES = [18.25, 36.5, 54.75]
WHOLE = "MED_NO_PROFILE_INTERNAL"


def write_med(path, random, *, rows=None):
    """A plate of 12 quadrilaterals with three modes, at some of its nodes if rows are given."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    corner = np.array([4 * i + j for i in range(4) for j in range(3)])
    quads = corner[:, None] + np.array([0, 4, 5, 1])
    meshio.Mesh(points, [("quad", quads)]).write(path)
    vectors = random.standard_normal((3, len(points), 3))
    nodes = np.arange(len(points)) if rows is None else rows
    with h5py.File(path, "r+") as file:
        field = file.require_group("CHA").create_group("DEPL")
        field.attrs["NCO"], field.attrs["MAI"] = 3, np.bytes_("mesh")
        for number, (frequency, vector) in enumerate(zip(FREQUENCIES, vectors, strict=True)):
            step = field.create_group(f"{number + 1:020d}{number + 1:020d}")
            step.attrs["PDT"] = frequency
            add_values(file, step.create_group("NOE"), vector[nodes], rows)
    return points, quads, vectors


def add_values(file, group, values, rows=None, gauss=1):
    profile = WHOLE if rows is None else "half"
    group.attrs["PFL"] = np.bytes_(profile)
    inner = group.create_group(profile)
    inner.attrs["NBR"], inner.attrs["NGA"] = len(values), gauss
    inner["CO"] = values.ravel(order="F")
    if rows is not None and "PROFILS/half" not in file:
        file["PROFILS/half/PFL"] = rows + 1


def test_a_field_on_cells_beside_the_modes_is_left_out_with_a_remark(tmp_path):
    path = tmp_path / "plate.med"
    _, _, vectors = write_med(path, np.random.default_rng(1))
    with h5py.File(path, "r+") as file:
        stress = file["CHA"].create_group("SIEF_ELGA")
        stress.attrs["NCO"] = 6
        step = stress.create_group("1")
        step.attrs["PDT"] = FREQUENCIES[0]
        add_values(file, step.create_group("MAI.QU4"), np.ones((12, 24)), gauss=4)
    shapes = read_shapes(path)
    np.testing.assert_allclose(shapes.frequencies, FREQUENCIES)
    np.testing.assert_allclose(shapes.vectors, vectors)
    (remark,) = shapes.remarks
    assert "plate.med: SIEF_ELGA has values on cells" in remark


def test_modes_on_a_profile_are_read_with_the_cells_of_its_nodes(tmp_path):
    path, rows = tmp_path / "plate.med", np.arange(12)
    points, _, vectors = write_med(path, np.random.default_rng(2), rows=rows)
    shapes = read_shapes(path)
    np.testing.assert_allclose(shapes.points, points[rows])
    np.testing.assert_allclose(shapes.vectors, vectors[:, rows])
    assert len(shapes.triangles) == 2 * 6
    assert "8 of 20 nodes lie outside the profile" in shapes.remarks[0]


def test_a_med_file_is_read_as_meshio_reads_it(tmp_path):
    path = tmp_path / "plate.med"
    points, quads, vectors = write_med(path, np.random.default_rng(3))
    expected = meshio.read(path)
    np.testing.assert_array_equal(expected.points, points)
    np.testing.assert_array_equal(expected.cells[0].data, quads)
    named = [f"DEPL[{k}] - {f:g}" for k, f in enumerate(FREQUENCIES)]
    for name, vector in zip(named, vectors, strict=True):
        np.testing.assert_array_equal(expected.point_data[name], vector)
    np.testing.assert_array_equal(read_shapes(path).vectors, vectors)


def move_mesh(file):
    file["ENS_MAA/other"] = h5py.ExternalLink("other.med", "/ENS_MAA/mesh")


def break_profile(file):
    file["PROFILS/half/PFL"][0] = 1000


def lose_values(file):
    step = next(iter(file["CHA/DEPL"].values()))
    del step["NOE/half/CO"]
    step["NOE/half/CO"] = np.ones(7)


def lose_points(file):
    del file["ENS_MAA"]


@pytest.mark.parametrize("damage", [move_mesh, break_profile, lose_values, lose_points])
def test_a_damaged_med_file_is_refused(tmp_path, damage):
    path = tmp_path / "plate.med"
    write_med(path, np.random.default_rng(4), rows=np.arange(12))
    with h5py.File(path, "r+") as file:
        damage(file)
    with pytest.raises(InputError, match=r"plate\.med cannot be read as a mesh \("):
        read_shapes(path)
