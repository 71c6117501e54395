"""Which fields of a finite-element file are displacement shapes, and the numbers of modes."""

import meshio
import numpy as np
import pytest

from identification.shapes import read_shapes
from identification.shapes.fe_fields import best_real_shape
from identification.words import InputError

GRID = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HERTZ = (12.5, 30.25, 30.25, 47.0)


@pytest.fixture
def read(tmp_path):
    """Reads a mesh with point data by name."""

    def read_written(data, frequencies=None):
        path = tmp_path / "plate.vtu"
        meshio.Mesh(GRID, [("quad", np.array([[0, 1, 2, 3]]))], point_data=data).write(path)
        table = None
        if frequencies is not None:
            table = tmp_path / "hz.txt"
            table.write_text("\n".join(map(str, frequencies)))
        return read_shapes(path, table)

    return read_written


def fields(pattern, seed, numbers=(1, 2, 3, 4)):
    """Random fields named by a pattern with number and frequency."""
    random = np.random.default_rng(seed)
    return {
        pattern.format(n=n, f=f): random.normal(size=GRID.shape)
        for n, f in zip(numbers, HERTZ, strict=True)
    }


@pytest.mark.parametrize(
    ("displacement", "left_out"),
    [
        ("mode {n} ({f} Hz)", ["rotation mode {n} ({f} Hz)"]),
        ("U mode {n} ({f} Hz)", ["UR mode {n} ({f} Hz)", "RF mode {n} ({f} Hz)"]),
        ("U{n} f={f}", ["Reaction{n} f={f}", "VELO{n} f={f}"]),
        ("MODES_DEPL[{n}] - {f}", ["MODES_REAC_NODA[{n}] - {f}", "MODES_SIEQ_NOEU[{n}] - {f}"]),
        ("eigenvector_{n} freq={f}", ["eigenvector_residual_{n} freq={f}"]),
        ("Displacement {n} ({f} Hz)", ["Pseudo {n} ({f} Hz)", "nodalForce {n} ({f} Hz)"]),
        ("mode {n} ({f} Hz)", ["theta mode {n} ({f} Hz)"]),
    ],
)
def test_fields_of_other_quantities_are_left_out_and_named(read, displacement, left_out):
    shapes = fields(displacement, 1)
    data = {
        name: values
        for k, field in enumerate(left_out)
        for name, values in fields(field, 2 + k).items()
    }
    read_shapes = read(data | shapes)
    np.testing.assert_allclose(read_shapes.vectors, list(shapes.values()))
    (remark,) = read_shapes.remarks
    assert all(field.format(n=1, f=12.5) in remark for field in left_out)


def test_fields_of_other_quantities_do_not_count_beside_a_table_of_frequencies(read):
    shapes = fields("mode_{n}", 1)
    read_shapes = read(shapes | fields("rotation_{n}", 2), HERTZ)
    np.testing.assert_allclose(read_shapes.vectors, list(shapes.values()))


def test_modes_with_names_of_their_own_all_count(read):
    names = ["rigid rotation about x (0 Hz)", "bending (12 Hz)", "torsion (30 Hz)", "sway (30 Hz)"]
    read_shapes = read({name: GRID + k for k, name in enumerate(names)})
    assert read_shapes.frequencies.tolist() == [0, 12, 30, 30]
    assert read_shapes.numbers.tolist() == [1, 2, 3, 4]
    assert not read_shapes.remarks


def test_a_file_of_rotations_alone_is_refused(read):
    with pytest.raises(
        InputError, match=r"no displacement shapes: .* rotation 1 \(12.5 Hz\) \.\. \(4"
    ):
        read(fields("rotation {n} ({f} Hz)", 1))


def test_two_fields_a_mode_that_no_name_tells_apart_are_refused(read):
    with pytest.raises(InputError, match=r"two fields a mode, alpha 1 .* and beta 1 .*neither"):
        read(fields("alpha {n} ({f} Hz)", 1) | fields("beta {n} ({f} Hz)", 2))


@pytest.mark.parametrize(
    "parts", [("{} real", "{} imag"), ("Re({})", "Im({})"), ("{}", "{} imaginary")]
)
def test_real_and_imaginary_parts_are_joined_and_turned_to_real_shapes(read, parts):
    shapes = fields("mode {n} ({f} Hz)", 1)
    turned = {name: np.exp(0.7j * k) * values for k, (name, values) in enumerate(shapes.items())}
    real, imaginary = parts
    read_shapes = read(
        {real.format(name): values.real for name, values in turned.items()}
        | {imaginary.format(name): values.imag for name, values in turned.items()}
    )
    assert len(read_shapes) == 4
    for vector, shape in zip(read_shapes.vectors, shapes.values(), strict=True):
        assert abs(np.sum(vector * shape)) == pytest.approx(np.sum(shape**2))
        np.testing.assert_allclose(np.abs(vector), np.abs(shape), atol=1e-12)
    (remark,) = read_shapes.remarks
    assert "4 complex modes were joined" in remark


def test_imaginary_parts_without_a_real_one_are_left_out(read):
    read_shapes = read(fields("mode {n} ({f} Hz)", 1) | {"mode 9 (80 Hz) imag": GRID})
    assert len(read_shapes) == 4
    assert "imaginary without a real part" in read_shapes.remarks[0]


def test_the_best_real_shape_has_the_largest_real_part_of_all_turns():
    random = np.random.default_rng(3)
    shape = random.normal(size=(5, 3)) + 1j * random.normal(size=(5, 3))
    real, rest = best_real_shape(shape)
    largest = max(
        np.linalg.norm((shape * np.exp(1j * a)).real) for a in np.linspace(0, np.pi, 2000)
    )
    assert np.linalg.norm(real) == pytest.approx(largest, rel=1e-5)
    assert rest == pytest.approx(np.sqrt(1 - (largest / np.linalg.norm(shape)) ** 2), rel=1e-3)
    assert best_real_shape(np.zeros((2, 3)))[1] == 0


@pytest.mark.parametrize(
    ("pattern", "numbers", "expected"),
    [
        ("mode_{n} f={f}", (7, 8, 9, 12), [7, 8, 9, 12]),
        ("U{n} ({f} Hz)", (3, 4, 5, 6), [3, 4, 5, 6]),
        ("load 2 mode {n} ({f} Hz)", (4, 2, 3, 1), [4, 2, 3, 1]),
        ("DEPL[{n}] - {f}", (6, 7, 8, 9), [7, 8, 9, 10]),
        ("f={f}, mode {n}", (5, 6, 7, 8), [5, 6, 7, 8]),
    ],
)
def test_modes_keep_the_numbers_of_their_names(read, pattern, numbers, expected):
    read_shapes = read(fields(pattern, 1, numbers))
    assert read_shapes.numbers.tolist() == expected
    assert read_shapes.select(np.array([1, 3])).numbers.tolist() == [expected[1], expected[3]]


def test_a_field_without_a_frequency_beside_modes_is_remarked(read):
    read_shapes = read(fields("mode {n} ({f} Hz)", 1) | {"static": GRID})
    assert read_shapes.remarks == ("plate.vtu: static: without a frequency, left out",)
