"""Mode shapes of a finite-element model: points, displacements, frequencies, faces."""

from dataclasses import dataclass

import numpy as np

from identification.words import Integers, Mask, Real


@dataclass(frozen=True, eq=False)
class Shapes:
    """Modes on a mesh.

    Args:
        source: the file they come from.
        points: (n_point, 3) [m].
        triangles: faces as corners, for places between points and for pictures; (n_triangle, 3).
        frequencies: rising; (n_mode,) [Hz].
        vectors: displacements, in any normalisation, one for all modes; (n_mode, n_point, 3).
    """

    source: str
    points: Real
    triangles: Integers
    frequencies: Real
    vectors: Real

    def __len__(self) -> int:
        """How many modes there are."""
        return len(self.frequencies)

    @property
    def extent(self) -> float:
        """Diagonal of the box around the mesh [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def only(self, modes: Integers | Mask) -> "Shapes":
        """Some of the modes."""
        return Shapes(
            self.source,
            self.points,
            self.triangles,
            self.frequencies[modes],
            self.vectors[modes],
        )
