"""Write FRFs and coherences as a universal file: dataset 164 once, then datasets 58b.

58b is dataset 58 with an ASCII header of eleven lines and little-endian binary data behind it.
Each FRF (function type 4, single complex) is followed by its coherence (type 6, single real), if
there is one.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from truth.campaign.measure import Measurement

_FRF_CODE, _COHERENCE_CODE = 4, 6
_SINGLE_REAL, _SINGLE_COMPLEX = 2, 5
_NO_QUANTITY, _ACCELERATION, _EXCITATION, _FREQUENCY = 0, 12, 13, 18
_DELIMITER = f"{-1:6d}\n".encode("ascii")


def uff_bytes(measurement: Measurement) -> bytes:
    """Return the file's content; the values are rounded to single precision."""
    parts = [_units()]
    for column, reference in enumerate(measurement.references):
        for row, response in enumerate(measurement.responses):
            pairs = [(_FRF_CODE, measurement.frf[:, row, column].astype("<c8"))]
            if measurement.coherence is not None:
                pairs.append((_COHERENCE_CODE, measurement.coherence[:, row, column].astype("<f4")))
            for kind, values in pairs:
                spacing = float(measurement.freq_hz[1] - measurement.freq_hz[0])
                start = float(measurement.freq_hz[0])
                parts.append(_function(kind, values, response, reference, (start, spacing)))
    return b"".join(parts)


def _units() -> bytes:
    """Return dataset 164: SI, temperatures absolute, all factors 1."""
    unit, offset = (f"{value:25.16E}".replace("E", "D") for value in (1.0, 273.15))
    lines = (f"{164:6d}", f"{1:10d}{'SI: Meter (newton)':<20}{2:10d}", unit + unit + unit, offset)
    return _DELIMITER + "".join(f"{line}\n" for line in lines).encode("ascii") + _DELIMITER


def _function(
    kind: int,
    values: NDArray[np.complex64] | NDArray[np.float32],
    response: tuple[int, int],
    reference: tuple[int, int],
    abscissa: tuple[float, float],
) -> bytes:
    """Return one dataset 58b; the points are (node, direction), the abscissa (start, spacing)."""
    is_frf = kind == _FRF_CODE
    data = values.tobytes()
    if len(data) != values.size * struct.calcsize("<ff" if is_frf else "<f"):
        raise TypeError(f"dataset 58b: {values.dtype} is not single precision")
    over = (_ACCELERATION, "Acceleration", "m/s^2") if is_frf else (_NO_QUANTITY, "NONE", "NONE")
    under = (_EXCITATION, "Force", "N") if is_frf else (_NO_QUANTITY, "NONE", "NONE")
    header = (
        f"{58:6d}b{1:6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}",
        f"{'accelerance' if is_frf else 'coherence':<80}",
        *[f"{'NONE':<80}"] * 4,
        f"{kind:5d}{0:10d}{1:5d}{0:10d} {'NONE':>10}{response[0]:10d}{response[1]:4d}"
        f" {'NONE':>10}{reference[0]:10d}{reference[1]:4d}",
        f"{_SINGLE_COMPLEX if is_frf else _SINGLE_REAL:10d}{values.size:10d}{1:10d}"
        f"{abscissa[0]:13.5e}{abscissa[1]:13.5e}{0:13.5e}",
        _axis(_FREQUENCY, "Frequency", "Hz"),
        _axis(*over),
        _axis(*under),
        _axis(_NO_QUANTITY, "NONE", "NONE"),
    )
    ascii_lines = "".join(f"{line}\n" for line in header).encode("ascii")
    return _DELIMITER + ascii_lines + data + b"\n" + _DELIMITER


def _axis(data_type: int, label: str, unit: str) -> str:
    return f"{data_type:10d}{0:5d}{0:5d}{0:5d} {label:<20} {unit:<20}"
