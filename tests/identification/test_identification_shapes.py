"""Finite-element shapes: files, and shapes at sensors."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.optimize import minimize

from identification.shapes import (
    closest_barycentric,
    read_shapes,
    shapes_at,
)
from identification.shapes.fe_file import Shapes
from identification.words import InputError

GONDOLA = Path(__file__).parents[2] / "assets" / "gondola" / "shapes.vtu"


def plate(random, count=3):
    """A bent plate of quadrilaterals and triangles with some modes."""
    x, y = np.meshgrid(np.linspace(0, 2, 5), np.linspace(0, 1, 4), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0.2 * x.ravel() ** 2])
    corner = np.array([4 * i + j for i in range(4) for j in range(3)])
    quads = corner[:, None] + np.array([0, 4, 5, 1])
    cells = [("quad", quads[:-2]), ("triangle", quads[-2:][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))]
    vectors = random.standard_normal((count, len(points), 3))
    return points, cells, vectors


def written(path, points, cells, data, **kwargs):
    meshio.Mesh(points, cells, point_data=data).write(path, **kwargs)
    return path


@pytest.mark.parametrize("ending", ["vtu", "xdmf", "med"])
@pytest.mark.parametrize("named", ["mode {0} ({1} Hz)", "u{0} f={1}", "DEPL[{0}] - {1}"])
def test_shapes_come_out_of_a_mesh_as_they_went_in(tmp_path, ending, named):
    points, cells, vectors = plate(np.random.default_rng(1), 11)
    frequencies = np.round(np.linspace(95.0, 12.5, 11), 3)  # falling: they come out rising
    data = {
        named.format(k + 1, f): v for k, (f, v) in enumerate(zip(frequencies, vectors, strict=True))
    }
    shapes = read_shapes(written(tmp_path / f"plate.{ending}", points, cells, data))
    assert len(shapes) == 11
    np.testing.assert_allclose(shapes.frequencies, frequencies[::-1])
    np.testing.assert_allclose(shapes.vectors, vectors[::-1], rtol=1e-6)
    np.testing.assert_allclose(shapes.points, points, atol=1e-12)
    assert len(shapes.triangles) == 24
    area = np.linalg.norm(
        np.cross(*np.diff(points[shapes.triangles], axis=1).transpose(1, 0, 2)), axis=1
    )
    bent = np.hypot(np.diff(points[::4, 0]), np.diff(points[::4, 2])).sum()
    assert area.sum() / 2 == pytest.approx(bent)


def test_the_steps_of_a_series_are_modes_at_their_values(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # beside which the writer puts its numbers
    points, cells, vectors = plate(np.random.default_rng(4), 12)
    frequencies = np.linspace(12.5, 95.25, 12)
    path = tmp_path / "plate.xdmf"
    with meshio.xdmf.TimeSeriesWriter(path) as writer:
        writer.write_points_cells(points, cells)
        for frequency, vector in zip(frequencies, vectors, strict=True):
            writer.write_data(frequency, point_data={"U": vector, "T": vector[:, 0]})
    shapes = read_shapes(path)
    np.testing.assert_allclose(shapes.frequencies, frequencies)
    np.testing.assert_allclose(shapes.vectors, vectors)


def test_frequencies_stand_in_a_table_in_the_order_of_the_shapes(tmp_path):
    points, cells, vectors = plate(np.random.default_rng(2), 12)
    data = {f"mode{k + 1}": vector for k, vector in enumerate(vectors)}  # mode10 after mode9
    mesh = written(tmp_path / "plate.vtu", points, cells, data)
    table = tmp_path / "modes.csv"
    table.write_text("mode;Hz\n" + "".join(f"{k + 1};{10.5 + k}\n" for k in range(12)))
    shapes = read_shapes(mesh, table)
    np.testing.assert_allclose(shapes.frequencies, 10.5 + np.arange(12))
    np.testing.assert_allclose(shapes.vectors, vectors)
    table.write_text("".join(f"{10.5 + k}\n" for k in range(11)))
    with pytest.raises(InputError, match=r"11 frequencies for the 12 shapes .*mode1 \.\. mode12"):
        read_shapes(mesh, table)


def test_what_is_no_mesh_with_shapes_is_refused_by_name(tmp_path):
    points, cells, vectors = plate(np.random.default_rng(3))
    with pytest.raises(InputError, match="is not there"):
        read_shapes(tmp_path / "none.vtu")
    (tmp_path / "bad.vtu").write_text("<VTKFile>")
    with pytest.raises(InputError, match="cannot be read as a mesh"):
        read_shapes(tmp_path / "bad.vtu")
    flat = written(tmp_path / "flat.vtu", points, cells, {"temperature": vectors[0][:, 0]})
    with pytest.raises(InputError, match=r"no shapes.*temperature"):
        read_shapes(flat)
    unnamed = written(tmp_path / "unnamed.vtu", points, cells, {"mode1": vectors[0]})
    with pytest.raises(InputError, match=r"name no frequencies.*--frequencies"):
        read_shapes(unnamed)
    broken = vectors[0].copy()
    broken[3, 1] = np.nan
    holed = written(tmp_path / "holed.vtu", points, cells, {"mode 1 (3 Hz)": broken})
    with pytest.raises(InputError, match=r"mode 1 \(3 Hz\) holds values that are no numbers"):
        read_shapes(holed)
    dots = [("vertex", np.array([[0], [1]]))]
    spots = written(tmp_path / "spots.vtu", points, dots, {"mode 1 (3 Hz)": vectors[0]})
    with pytest.raises(InputError, match=r"no faces \(vertex\)"):
        read_shapes(spots)
    for name in ("mode 1 (34,50 Hz)", "mode 1 (x Hz)"):
        comma = written(tmp_path / "comma.vtu", points, cells, {name: vectors[0]})
        with pytest.raises(InputError, match=r"holds no frequency.* with a point"):
            read_shapes(comma)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("10,5\n20,5\n30,7", "row 2, '20,5', is not a frequency"),
        ("1 10,5\n2 20,5\n3 30,7", "row 1, '1 10,5', is not a frequency"),
        ("1,10.5,1.0\n2,20.5,1.0\n3,30.7,1.0", "row 1, '1,10.5,1.0', is not a frequency"),
        ("10.5 1.5\n20.5 1.5\n30.7 1.5", "row 1, '10.5 1.5', is not a frequency"),
        ("10.5\nf2=20.5\n30.7", "row 2, 'f2=20.5', is not a frequency"),
        ("1 10.5\n2 nan\n3 30.7", "frequency of shape 2 is no number"),
        ("10.5\n30.7\n20.5", r"fall from 30.7 to 20.5 Hz, where modes rise"),
        ("30\n30\n30", "all 3 frequencies are 30 Hz"),
        (b"fr\xe9quence\n10.5\n20.5\n30.7", "cannot be read as text"),
    ],
)
def test_a_table_of_something_else_is_refused_by_its_row(tmp_path, rows, said):
    points, cells, vectors = plate(np.random.default_rng(3))
    data = {f"mode{k + 1}": vector for k, vector in enumerate(vectors)}
    mesh = written(tmp_path / "plate.vtu", points, cells, data)
    table = tmp_path / "modes.txt"
    table.write_bytes(rows if isinstance(rows, bytes) else rows.encode())
    with pytest.raises(InputError, match=said):
        read_shapes(mesh, table)


@pytest.mark.parametrize(
    "rows",
    [
        "7,10.5\n8,20.5\n9,30.75",
        "# by hand\n10.5\n\n20.5 Hz\n30.75",
        "mode 7: 10.5 Hz\nmode 8: 20.5 Hz\nmode 9: 30.75 Hz",
        "mode\tf\n2\t10.5\n5\t20.5\n9\t30.75",
        "\ufeff1.05e1\n.205e2\n30.75",
    ],
)
def test_a_table_may_number_its_modes_and_say_what_it_is(tmp_path, rows):
    points, cells, vectors = plate(np.random.default_rng(3))
    data = {f"mode{k + 1}": vector for k, vector in enumerate(vectors)}
    mesh = written(tmp_path / "plate.vtu", points, cells, data)
    table = tmp_path / "modes.txt"
    table.write_text(rows, encoding="utf-8")
    assert read_shapes(mesh, table).frequencies.tolist() == [10.5, 20.5, 30.75]


def test_beams_hold_sensors_too(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]])
    shape = np.array([[0.0, 0, 1], [0, 0, 2], [0, 0, 6]])
    cells = [("line", np.array([[0, 1], [1, 2]]))]
    shapes = read_shapes(written(tmp_path / "beam.vtu", points, cells, {"mode 1 (.5 Hz)": shape}))
    assert shapes.frequencies.tolist() == [0.5]
    at = shapes_at(shapes, np.array([[0.5, 0.0, 0.01], [2.0, 0.02, 0.0]]), ["a", "b"])
    np.testing.assert_allclose(at[0, :, 2], [1.5, 4.0])


@pytest.mark.parametrize("kind", ["tetra", "hexahedron"])
def test_volumes_have_their_outside_alone(tmp_path, kind):
    grid = np.array([[x, y, z] for x in range(3) for y in range(3) for z in range(3)], float)
    corner = [(9 * x + 3 * y + z) for x in range(2) for y in range(2) for z in range(2)]
    boxes = np.array([[c, c + 9, c + 12, c + 3, c + 1, c + 10, c + 13, c + 4] for c in corner])
    cells = [("hexahedron", boxes)]
    if kind == "tetra":
        parts = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
        cells = [("tetra", np.concatenate([boxes[:, part] for part in parts]))]
    data = {"mode 1 (3 Hz)": grid}
    shapes = read_shapes(written(tmp_path / "box.vtu", grid, cells, data))
    faces = shapes.points[shapes.triangles]
    area = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1)
    assert area.sum() / 2 == pytest.approx(6 * 4.0)


def test_the_closest_point_of_a_triangle_is_that_of_a_minimiser():
    random = np.random.default_rng(4)
    a, b, c = random.standard_normal((3, 40, 3))
    c[0] = a[0] + 2 * (b[0] - a[0])  # one without area
    for position in random.standard_normal((5, 3)):
        share = closest_barycentric(position, a, b, c)
        assert (share >= -1e-12).all()
        np.testing.assert_allclose(share.sum(axis=1), 1.0)
        found = np.linalg.norm(
            (share[:, :, None] * np.stack([a, b, c], axis=1)).sum(axis=1) - position, axis=1
        )
        for k in range(0, 40, 3):

            def apart(v, k=k, position=position):
                place = a[k] + v[0] * (b[k] - a[k]) + v[1] * (c[k] - a[k])
                return float(np.sum((place - position) ** 2))

            inside = {"type": "ineq", "fun": lambda v: 1 - v[0] - v[1]}
            best = min(
                minimize(
                    apart, start, bounds=[(0, 1)] * 2, constraints=[inside], method="SLSQP"
                ).fun
                for start in ([0.1, 0.1], [0.8, 0.1], [0.1, 0.8])
            )
            assert found[k] == pytest.approx(np.sqrt(best), abs=1e-4)


def test_a_field_that_is_linear_is_exact_between_points_and_stepped_at_the_nearest():
    random = np.random.default_rng(5)
    points, cells, _ = plate(random)
    slope = random.standard_normal((2, 3, 3))
    vectors = np.einsum("mij,pj->mpi", slope, points)
    triangles = np.concatenate([cells[0][1][:, [0, 1, 2]], cells[0][1][:, [0, 2, 3]], cells[1][1]])
    shapes = Shapes("plate", points, triangles, np.array([1.0, 2.0]), vectors)
    corners = points[triangles[[3, 8, 15]]]
    places = corners.mean(axis=1)
    names = ["acc1", "acc2", "acc3"]
    found = shapes_at(shapes, places, names)
    np.testing.assert_allclose(found, np.einsum("mij,pj->mpi", slope, places), atol=1e-12)
    nearest = shapes_at(shapes, places, names, sampling="nearest", max_distance=1.0)
    apart = np.linalg.norm(points[None] - places[:, None], axis=2).argmin(axis=1)
    np.testing.assert_array_equal(nearest, vectors[:, apart])


def test_a_sensor_off_the_mesh_is_named_with_its_distance():
    points, cells, vectors = plate(np.random.default_rng(6))
    shapes = Shapes("plate.vtu", points, cells[1][1], np.arange(1.0, 4.0), vectors)
    places = np.array([points[18], points[18] + [0, 0, 0.7]])
    with pytest.raises(InputError, match=r"acc9 at .* is 0\.\d+ m off the mesh of plate\.vtu"):
        shapes_at(shapes, places, ["acc1", "acc9"])
    millimetres = 1000 * places
    with pytest.raises(InputError, match=r"2 sensors are off.*in metres"):
        shapes_at(shapes, millimetres, ["acc1", "acc9"])


def test_a_mesh_in_millimetres_is_refused():
    points, cells, vectors = plate(np.random.default_rng(6))
    triangles = cells[1][1]
    shapes = Shapes("mm.vtu", 1000 * points, triangles, np.arange(3.0), vectors)
    with pytest.raises(InputError, match=r"within 1.12 m of each other .* Is it in millimetres"):
        shapes_at(shapes, points[[0, 3, 7]], ["a", "b", "c"])
