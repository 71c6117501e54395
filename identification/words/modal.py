"""Modal model: poles, mode shapes, their scaling, and residuals of modes outside the band.

Natural frequencies and damping ratios of objects that have poles.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.words._arrays import Complex, Real, frozen_array
from identification.words.errors import UsageError
from identification.words.frf import DERIVATIVE_ORDER, Frf, Quantity
from identification.words.names import shorten_names
from identification.words.ports import Input, Output


class HasPoles:
    """Base class that derives natural frequencies and damping ratios from poles.

    A pole is s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4).

    Attributes:
        poles: s_r [rad/s]; (n_mode,).
    """

    poles: Complex

    @property
    def freq_hz(self) -> Real:
        """Natural frequencies |s_r| / 2 pi [Hz]; (n_mode,)."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damping(self) -> Real:
        """Damping ratios zeta_r = -Re s_r / |s_r|, 0 for a pole at rest; (n_mode,)."""
        size = np.abs(self.poles)
        return np.where(size > 0, -self.poles.real / np.where(size > 0, size, 1.0), 0.0)


class HasModes(Protocol):
    """Interface to poles, shapes, participation and residuals, as in ``ModalModel``."""

    @property
    def poles(self) -> Complex:
        """Poles s_r [rad/s]; (n_mode,)."""

    @property
    def shapes(self) -> Complex:
        """Mode shapes phi_r; (n_out, n_mode)."""

    @property
    def participation(self) -> Complex:
        """Modal participation l_r; (n_in, n_mode)."""

    @property
    def lower(self) -> Real:
        """Residual v of modes below the band; (n_out, n_in)."""

    @property
    def upper(self) -> Real:
        """Residual u of modes above the band; (n_out, n_in)."""


def modal_sum(modes: HasModes, laplace: Complex, order: int) -> Complex:
    """Compute FRFs by modal superposition (seed, eq. 3.5 to 3.7).

    H(s) = s^q [sum_r phi_r l_r' / (s - s_r) + conjugate + v / s^2 + u]

    Args:
        modes: poles, shapes, participation and residuals.
        laplace: Laplace variable s of every line [rad/s]; (n_freq,).
        order: exponent q: 0, 1, 2 for receptance, mobility, accelerance.

    Returns:
        FRFs; (n_freq, n_out, n_in).
    """
    residues = modes.shapes[:, None, :] * modes.participation
    s = laplace[:, None]
    power = s**order
    curves = [power / (s - modes.poles), power / (s - modes.poles.conj()), power]
    factors = [residues, residues.conj(), modes.upper[:, :, None]]
    if modes.lower.any():  # at 0 Hz s^(q - 2) is infinite, which matters only for a lower residual
        curves.append(s ** (order - 2))
        factors.append(modes.lower[:, :, None])
    coefficients = np.concatenate(factors, axis=2)
    values: Complex = np.hstack(curves) @ coefficients.reshape(-1, coefficients.shape[2]).T
    return values.reshape(len(laplace), *coefficients.shape[:2])


def drive_point_scale(driven: Complex, participation: Complex) -> Complex:
    """Compute the modal scaling a_r from all drive points together (seed, eq. 3.7).

    For each input i and output o the receptance has phi_ir phi_or / a_r = l_ri phi_or. The
    drive points d give a_r = phi_d^H phi_d / phi_d^H l_d.

    Args:
        driven: shapes phi_d at the drive points; (n_drive, n_mode).
        participation: participation l_d at the drive points; (n_drive, n_mode).

    Returns:
        Scaling a_r of receptance [kg/s]; (n_mode,).
    """
    size = (np.abs(driven) ** 2).sum(axis=0)
    return size / (driven.conj() * participation).sum(axis=0)


@dataclass(frozen=True, eq=False)
class ModalModel(HasPoles):
    """Modal model of a machine, identified from FRFs or computed from a model.

    The receptance between output ``o`` and input ``i`` is, with s = i w and time convention
    exp(+i w t),

        H_oi(s) = sum_r phi_or l_ri / (s - s_r) + conjugate + v_oi / s^2 + u_oi

    Args:
        poles: s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4) [rad/s]; (n_mode,).
        shapes: mode shapes phi_r; (n_out, n_mode).
        participation: modal participation l_r; (n_in, n_mode).
        lower: residual v of modes below the band; (n_out, n_in).
        upper: residual u of modes above the band; (n_out, n_in).
        outputs: degrees of freedom of the shapes; n_out.
        inputs: degrees of freedom or motors of the participation; n_in.
        freq_sd: standard deviations of the natural frequencies [Hz]; (n_mode,).
        damping_sd: standard deviations of the damping ratios; (n_mode,).

    Raises:
        ValueError: the shape of an array contradicts this description.
    """

    poles: Complex
    shapes: Complex
    participation: Complex
    lower: Real
    upper: Real
    outputs: tuple[Output, ...]
    inputs: tuple[Input, ...]
    freq_sd: Real
    damping_sd: Real

    def __post_init__(self) -> None:
        """Validate and freeze."""
        m, n_out, n_in = len(self.poles), len(self.outputs), len(self.inputs)
        for name, kind, shape in (
            ("poles", np.complex128, (m,)),
            ("shapes", np.complex128, (n_out, m)),
            ("participation", np.complex128, (n_in, m)),
            ("lower", np.float64, (n_out, n_in)),
            ("upper", np.float64, (n_out, n_in)),
            ("freq_sd", np.float64, (m,)),
            ("damping_sd", np.float64, (m,)),
        ):
            object.__setattr__(self, name, frozen_array(getattr(self, name), kind, shape, name))
        for name in ("freq_sd", "damping_sd"):
            if (getattr(self, name) < 0).any():
                raise ValueError(f"{name} is negative: a standard deviation is 0 or more")
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "inputs", tuple(self.inputs))

    def __repr__(self) -> str:
        """Return the natural frequencies and the number of outputs and inputs in one line."""
        listed = shorten_names([f"{value:.4g}" for value in self.freq_hz])
        return (
            f"{len(self.poles)} modes at {listed} Hz; {len(self.outputs)} outputs, "
            f"{len(self.inputs)} inputs"
        )

    @property
    def drive_points(self) -> tuple[Complex, Complex]:
        """Shapes and participation at inputs that are also outputs; (n_drive, n_mode) each."""
        where: dict[Input, int] = {dof.positive: row for row, dof in enumerate(self.outputs)}
        columns = [k for k, dof in enumerate(self.inputs) if dof.positive in where]
        rows = [where[self.inputs[k].positive] for k in columns]
        pairs = zip(rows, columns, strict=True)
        signs = np.array([self.outputs[row].sign * self.inputs[k].sign for row, k in pairs])
        return self.shapes[rows] * signs[:, None], self.participation[columns]

    @property
    def modal_a(self) -> Complex:
        """Modal scaling a_r of receptance from all drive points [kg/s] (seed, eq. 3.7); (n_mode,).

        Raises:
            UsageError: there is no drive point.
        """
        driven, participation = self.drive_points
        if not len(driven):
            raise UsageError(
                "no input is also measured as an output: without a drive point the modes have no "
                "scale; measure the response at the hammer point"
            )
        return drive_point_scale(driven, participation)

    def synthesise(self, freq_hz: Real, quantity: Quantity) -> Frf:
        """Synthesise the FRFs from every input to every output, residuals included.

        Args:
            freq_hz: frequencies [Hz], above 0 Hz if there is a residual of lower modes;
                (n_freq,).
        """
        laplace = np.asarray(2j * np.pi * np.asarray(freq_hz), np.complex128)
        values = modal_sum(self, laplace, DERIVATIVE_ORDER[quantity])
        return Frf(np.asarray(freq_hz), values, self.outputs, self.inputs, quantity)
