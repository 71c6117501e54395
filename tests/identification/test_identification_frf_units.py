"""Units of rotations, torques and signals beside those of translations and forces."""

import numpy as np
import pytest

from identification.readers.array_frfs import read_arrays
from identification.readers.array_records import read_array_records
from identification.readers.frf_units import parse_frf_units
from identification.words import Dof, InputError, Signal

FREQ = np.linspace(1.0, 9.0, 7)
CHANNELS, REFERENCES = ["1:+x", "2:+rz"], ["3:+x", "3:+rz", "drive"]
DEGREE, G, LBF = np.pi / 180, 9.80665, 4.4482216152605


def read(folder, unit, quantity="accelerance"):
    np.savez(folder / "a.npz", frf=np.ones((7, 2, 3), complex), freq_hz=FREQ)
    return read_arrays(
        folder / "a.npz", channels=CHANNELS, references=REFERENCES, quantity=quantity, unit=unit
    )


@pytest.mark.parametrize(
    ("quantity", "unit", "factors", "remark"),
    [
        ("accelerance", None, [[1, 1, 1], [1, 1, 1]], ""),
        ("accelerance", "m/s^2/N", [[1, 1, 1], [1, 1, 1]], ""),
        ("accelerance", "g/N", [[G, G, G], [1, 1, 1]], "no unit of rotations and torques"),
        ("accelerance", "g/N, deg/s^2/(N m)", [[G, G, G], [DEGREE] * 3], ""),
        ("accelerance", "rad/s^2/(N mm)", [[1, 1e3, 1], [1, 1e3, 1]], "translations and forces"),
        (
            "mobility",
            "mm/s/lbf, (mrad/s)/(lbf in)",
            [
                [1e-3 / LBF, 1e-3 / (LBF * 0.0254), 1e-3],
                [1e-3 / LBF, 1e-3 / (LBF * 0.0254), 1e-3],
            ],
            "",
        ),
        ("receptance", "um/count", [[1e-6] * 3, [1, 1, 1]], "no unit of rotations"),
        ("receptance", "rad/N, m/(N m)", [[1, 1, 1], [1, 1, 1]], ""),
        ("receptance", "counts/N", [[1, 1, 1], [1, 1, 1]], ""),
    ],
)
def test_each_kind_has_its_own_factor(tmp_path, quantity, unit, factors, remark):
    table = read(tmp_path, unit, quantity)
    assert table.references[2] == Signal("drive")
    np.testing.assert_allclose(table.values[3].real, factors, rtol=1e-12)
    assert (remark in " ".join(table.remarks)) if remark else not table.remarks


def test_records_are_converted_by_kind_too(tmp_path):
    arrays = {
        "force": np.ones((2, 1, 50)),
        "response": np.ones((2, 1, 2, 50)),
        "rate_hz": np.array(100.0),
    }
    first, second = read_array_records(
        tmp_path / "a.npz",
        arrays,
        channels=CHANNELS,
        references=["3:+x", "3:+rz"],
        quantity="accelerance",
        unit="g/kN, deg/s^2/(N m)",
    )
    np.testing.assert_allclose(first.motion[0, :, 0], [G / 1e3, DEGREE / 1e3])
    np.testing.assert_allclose(second.motion[0, :, 0], [G, DEGREE])


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("rad/s/N", 'set quantity = "mobility"'),
        ("furlong/N", "is not a unit of accelerance"),
        ("g/N, mm/s^2/N", "states two units of translations"),
        ("g", "is not a unit of accelerance"),
        ("g/N,", "is not a unit of accelerance"),
    ],
)
def test_wrong_units_are_refused(tmp_path, unit, words):
    with pytest.raises(InputError, match=r"a\.npz") as caught:
        read(tmp_path, unit)
    assert words in str(caught.value)


def test_the_scalar_is_that_of_translations_per_force(tmp_path):
    assert parse_frf_units(tmp_path, "accelerance", "g/N, deg/s^2/(N m)").scalar == G
    assert parse_frf_units(tmp_path, "accelerance", None).scalar == 1.0
    units = parse_frf_units(tmp_path, "receptance", "um/count")
    assert units.drive_factor(Dof("acc1", "+tx")) == 1.0
