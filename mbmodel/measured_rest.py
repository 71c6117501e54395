r"""Dynamic stiffness that a model lacks at the measured points, in one state of a machine.

With the receptance H of all measured points in the state before a change, and that of the model,

    E(w) = H_measured(w)^-1 - H_model(w)^-1,    Z(w) += F E(w) L,

F the forces of the references on the machine, L the rows of the channels. By the Woodbury identity
L (Z + F E L)^-1 F = (H_model^-1 + E)^-1, so that the model with its rest answers as measured. A
change of the model's Z by any Part then acts as it does in the real machine at these points: what
the model lacks is the same in dynamic stiffness in both states, and not in the FRFs.

If all stiffness is f times that of the state before, as by temperature, all frequencies of Z are
sqrt(f) times theirs, and so are those of the rest (damping apart). With f near 1,

    E_f(w) = f E(w / sqrt(f)) = E + (f - 1) D,    D = E - (w / 2) dE / dw.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Dof, Real, frozen_array


@dataclass(frozen=True, eq=False)
class MeasuredRest:
    """The dynamic stiffness that a model lacks, at the measured points.

    Args:
        outputs: channels, directions of points; n.
        inputs: references, directions of points; n.
        readout_shift: rows of the channels less those of the nominal model, by fitted places and
            angles of sensors; (n, 6 n_body).
        force_shift: forces of the references less those of the nominal model; (6 n_body, n).
        freq_hz: frequency lines [Hz], rising; (n_freq,).
        values: E [N/m]; (n_freq, n, n), ``values[k, i, j]`` the force at reference i per motion of
            channel j.
        drift: D [N/m]; (n_freq, n, n).
        scale_deviation: relative standard deviation of a factor on E that the tests cannot show:
            that of the calibration of forces and motions.

    Raises:
        ValueError: arrays whose shapes do not fit.
    """

    outputs: tuple[Dof, ...]
    inputs: tuple[Dof, ...]
    readout_shift: Real
    force_shift: Real
    freq_hz: Real
    values: Complex
    drift: Complex
    scale_deviation: float = 0.0

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        n, n_freq = len(self.outputs), len(self.freq_hz)
        if len(self.inputs) != n:
            raise ValueError(f"{n} channels and {len(self.inputs)} references, expected as many")
        for name, kind, shape in (
            ("readout_shift", np.float64, (n, None)),
            ("force_shift", np.float64, (None, n)),
            ("freq_hz", np.float64, (n_freq,)),
            ("values", np.complex128, (n_freq, n, n)),
            ("drift", np.complex128, (n_freq, n, n)),
        ):
            array = frozen_array(getattr(self, name), kind, shape, name)
            object.__setattr__(self, name, array)

    def at(self, laplace: Complex) -> Complex:
        """Return E at each s, by its imaginary part, linear between lines and constant beyond.

        Args:
            laplace: s [rad/s]; (m,).

        Returns:
            E [N/m], with E(conj s) = conj E(s); (m, n, n).
        """
        return self._interpolate(self.values, laplace)

    def drift_at(self, laplace: Complex) -> Complex:
        """Return D at each s, as ``at`` returns E; (m, n, n)."""
        return self._interpolate(self.drift, laplace)

    def drift_entry_at(self, row: int, column: int, laplace: Complex) -> Complex:
        """Return an entry of D at each s; (m,)."""
        return self._interpolate(self.drift[:, row, column], laplace)

    def _interpolate(self, table: Complex, laplace: Complex) -> Complex:
        """Return a table at each s, conjugate where s has a negative imaginary part."""
        freq, lines = np.abs(laplace.imag) / (2 * np.pi), self.freq_hz
        place = np.interp(freq, lines, np.arange(len(lines)))
        lower = np.minimum(place.astype(int), max(len(lines) - 2, 0))
        upper = np.minimum(lower + 1, len(lines) - 1)
        shape = (-1, *[1] * (table.ndim - 1))
        share = (place - lower).reshape(shape)
        between = (1 - share) * table[lower] + share * table[upper]
        return np.asarray(np.where(laplace.imag.reshape(shape) < 0, between.conj(), between))
