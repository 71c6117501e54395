"""Mode shapes to universal files and back, read by pyuff too."""

from datetime import UTC, datetime

import numpy as np
import pytest
import pyuff
from identification_examples import dataset, random_layout, units

from identification.readers.uff_modes import (
    NodeShapes,
    node_shapes,
    read_uff_modes,
    write_uff_modes,
)
from identification.words import Dof, InputError

WHEN = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)
POLES = np.array([-1.5 + 61.6j, -20.0 + 480.0j])
MODAL_A = np.array([0.1 + 123.2j, -3.0 + 960.0j])


@pytest.fixture
def layout():
    return random_layout(3, n_body=1, n_sensor=4)


@pytest.fixture
def shapes():
    rng = np.random.default_rng(8)
    return rng.normal(size=(11, 2)) + 1j * rng.normal(size=(11, 2))


@pytest.fixture
def outputs(layout):
    """Three triaxial sensors, one channel turned, and one with two channels."""
    dofs = [Dof.of(point, axis) for point in layout.points for axis in range(3)][:11]
    dofs[4] = Dof.of(dofs[4].point, 1, -1)
    return tuple(dofs)


@pytest.fixture
def written(layout, outputs, shapes, tmp_path):
    path = tmp_path / "modes.unv"
    modes = node_shapes(POLES, MODAL_A, shapes, outputs, layout)
    write_uff_modes(path, modes, "a machine: ä " + 100 * "x", WHEN)
    return path, modes


def test_what_was_written_is_read_back_to_six_digits(written):
    path, modes = written
    found = read_uff_modes(path)
    np.testing.assert_allclose(found.poles, POLES, rtol=1e-5)
    np.testing.assert_allclose(found.modal_a, MODAL_A, rtol=1e-5)
    np.testing.assert_array_equal(found.nodes, modes.nodes)
    np.testing.assert_allclose(found.values, modes.values, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.positions, modes.positions, rtol=1e-12)


def test_channels_come_back_whatever_the_axes_of_their_sensors(written, layout, outputs, shapes):
    found, there = read_uff_modes(written[0]).at_channels(outputs, layout)
    assert there.all()
    np.testing.assert_allclose(found, shapes, rtol=1e-4, atol=1e-4)


def test_pyuff_reads_every_dataset(written):
    path, modes = written
    file = pyuff.UFF(str(path))
    assert file.get_set_types().tolist() == [151, 164, 15, 2411, 55, 2414, 55, 2414]
    header, unit, _, nodes, first, analysis, *_ = file.read_sets()
    assert header["model_name"].startswith("a machine: ?")
    assert header["date_db_created"] == "04-Mar-26"
    assert (unit["length"], unit["force"]) == (1.0, 1.0)
    np.testing.assert_allclose(np.column_stack([nodes[k] for k in "xyz"]), modes.positions)
    assert first["analysis_type"] == 3
    assert first["eig"] == pytest.approx(POLES[0])
    assert first["modal_a"] == pytest.approx(MODAL_A[0])
    assert first["modal_b"] == pytest.approx(-POLES[0] * MODAL_A[0], rel=1e-5)
    for key, axis in zip(("r1", "r2", "r3"), range(3), strict=True):
        np.testing.assert_allclose(first[key], modes.values[:, axis, 0], rtol=1e-5, atol=1e-6)
    assert analysis["record13_field2"] == pytest.approx(POLES[0].imag)
    assert analysis["data_at_node"][1][2] == pytest.approx(modes.values[1, 1, 0].real, rel=1e-5)


def test_lines_are_no_longer_than_the_format_allows(written):
    assert max(map(len, written[0].read_text("ascii").splitlines())) <= 80


def test_without_55_the_datasets_2414_are_read(written, tmp_path):
    text = written[0].read_text("ascii")
    other = tmp_path / "other.unv"
    other.write_text(text.replace("\n    55\n", "\n    57\n"), encoding="ascii")
    np.testing.assert_allclose(
        read_uff_modes(other).values, written[1].values, rtol=1e-5, atol=1e-6
    )


def normal_mode(*, nodes=(1, 2), kind=2, frequency=12.5):
    lines = ["a", "b", "c", "d", "e", "".join(f"{k:10d}" for k in (1, kind, 2, 8, 2, 3))]
    lines.append("".join(f"{k:10d}" for k in (2, 4, 1, 1)))
    lines.append("".join(f"{v:13.5E}" for v in (frequency, 2.0, 0.03, 0.0)))
    for node in nodes:
        lines += [f"{node:10d}", "".join(f"{v:13.5E}" for v in (node, -0.5, 0.25))]
    return dataset("    55", lines)


def test_normal_modes_become_poles_by_frequency_and_damping(tmp_path):
    path = tmp_path / "fe.unv"
    single = [f"{2:10d}{0:10d}{0:10d}{0:10d}" + "".join(f"{v:13.5E}" for v in (1500, 0, -20))]
    path.write_bytes(units(1000.0, 1.0) + dataset("    15", single) + normal_mode())
    found = read_uff_modes(path)
    assert found.freq_hz == pytest.approx([12.5])
    assert found.damping == pytest.approx([0.03])
    assert found.modal_a == pytest.approx([2j * found.poles[0].imag * 2.0])
    np.testing.assert_allclose(found.values[:, :, 0], [[1, -0.5, 0.25], [2, -0.5, 0.25]])
    np.testing.assert_allclose(found.positions[1], [1.5, 0, -0.02])


def test_a_file_without_modes_is_refused(tmp_path):
    path = tmp_path / "static.unv"
    path.write_bytes(units(1.0, 1.0))
    with pytest.raises(InputError, match="holds no mode shape"):
        read_uff_modes(path)


def test_modes_at_different_nodes_are_refused(tmp_path):
    path = tmp_path / "two.unv"
    path.write_bytes(normal_mode() + normal_mode(nodes=(1, 3)))
    with pytest.raises(InputError, match="records 1 and 2 have different nodes"):
        read_uff_modes(path)


def test_points_without_a_number_get_one_and_rotations_are_left_out(layout):
    named = layout.with_copied_point("p0_0", "top").with_copied_point("p0_1", "side9")
    outputs = (Dof("side9", "+tx"), Dof("top", "+ty"), Dof("top", "+rz"))
    modes = node_shapes(POLES, np.zeros(0), np.ones((3, 2), complex), outputs, named)
    assert modes.nodes.tolist() == [9, 10]
    assert not modes.modal_a.any()
    np.testing.assert_allclose(modes.values[1, :, 0], named.axes[named.points.index("top")][:, 1])
    _, there = modes.at_channels(outputs, named)
    assert there.tolist() == [True, True, False]


def test_shapes_that_do_not_fit_their_nodes_are_refused():
    with pytest.raises(ValueError, match="values has shape"):
        NodeShapes(POLES, MODAL_A, np.array([1]), np.zeros((1, 3)), np.zeros((2, 3, 2)))
