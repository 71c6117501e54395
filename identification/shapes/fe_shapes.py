"""Mode shapes of a finite-element model on its mesh."""

from dataclasses import dataclass

import numpy as np

from identification.words import Integers, Mask, Real


@dataclass(frozen=True, eq=False)
class Shapes:
    """Modes on a mesh.

    Args:
        source: file that they were read from.
        points: (n_point, 3) [m].
        triangles: faces as corners, for places between points and for pictures; (n_triangle, 3).
        frequencies: rising; (n_mode,) [Hz].
        vectors: displacements, in any normalisation that is common to all modes; (n_mode, n_point,
            3).
        remarks: sentences on what was left out of the file.
        stated_numbers: numbers of the modes in the file; empty if it states none.
    """

    source: str
    points: Real
    triangles: Integers
    frequencies: Real
    vectors: Real
    remarks: tuple[str, ...] = ()
    stated_numbers: tuple[int, ...] = ()

    def __len__(self) -> int:
        """Return the number of modes."""
        return len(self.frequencies)

    @property
    def numbers(self) -> Integers:
        """Numbers of the modes: those in the file, else from 1 in the order of frequencies."""
        return np.array(self.stated_numbers or np.arange(1, len(self) + 1), np.intp)

    @property
    def extent(self) -> float:
        """Diagonal of the box around the mesh [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def select(self, modes: Integers | Mask) -> "Shapes":
        """Return some of the modes."""
        return Shapes(
            self.source,
            self.points,
            self.triangles,
            self.frequencies[modes],
            self.vectors[modes],
            self.remarks,
            tuple(self.numbers[modes].tolist()),
        )
