"""Arrays of the virtual machine, and checks of their values."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truth.errors import TruthError

Real: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Integer: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]

AXES = ("x", "y", "z")
GROUND = -1


def frozen(values: ArrayLike, shape: tuple[int, ...], what: str) -> Real:
    """Return a finite, read-only copy of the values in this shape, or refuse them by name."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise TruthError(f"{what}: expected finite numbers of shape {shape}, got {values!r}")
    array.setflags(write=False)
    return array


def is_inertia(inertia: Real) -> bool:
    """Tell whether a body can have this inertia: its moments positive, none above the others' sum.

    Both hold exactly when every eigenvalue of ``trace(I)/2 - I`` is non-negative, these being the
    principal second moments of the mass, and when I itself is positive definite.
    """
    moments = np.linalg.eigvalsh(inertia)
    rounding = 1e-9 * float(moments.sum())
    return bool(moments[0] > 0 and moments[2] <= moments[0] + moments[1] + rounding)
