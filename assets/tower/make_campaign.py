"""Convert the three files of the source to ``accelerance.npz``: ``python make_campaign.py FOLDER``.

Each file holds the motion of all floors for a force at one floor: on each line a frequency and the
accelerances of floors 1, 2, 3 as complex numbers, separated by semicolons. 32-bit floats keep seven
digits, which is far below the noise.
"""

import sys
from pathlib import Path

import numpy as np

FILES = ("Experimental.csv", "test_2.csv", "test_3.csv")  # force at floor 1, 2, 3


def main(folder: Path) -> None:
    """Read the files and write the FRFs beside this script."""
    tables = [
        np.loadtxt(folder / name, dtype=complex, delimiter=";", converters=_number)
        for name in FILES
    ]
    freq_hz = tables[0][:, 0].real
    if any(not np.array_equal(table[:, 0].real, freq_hz) for table in tables):
        raise SystemExit(f"{folder}: the files have different frequencies")
    frf = np.stack([table[:, 1:] for table in tables], axis=2).astype(np.complex64)
    target = Path(__file__).resolve().parent / "accelerance.npz"
    np.savez_compressed(target, frf=frf, freq_hz=freq_hz)


def _number(text: str) -> complex:
    return complex(text.strip().replace("+-", "-"))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
