"""A modal model: poles, shapes and their scaling, with what lies beside the band."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.words._arrays import Complex, Real, frozen
from identification.words.dof import Dof
from identification.words.errors import UsageError
from identification.words.frf import ORDER, Frf, Quantity
from identification.words.motor import Input
from identification.words.poles import HasPoles


class HasModes(Protocol):
    """Poles, shapes, participation and residuals, as in ``ModalModel``."""

    @property
    def poles(self) -> Complex:
        """(n_mode,)."""

    @property
    def shapes(self) -> Complex:
        """(n_out, n_mode)."""

    @property
    def participation(self) -> Complex:
        """(n_in, n_mode)."""

    @property
    def lower(self) -> Real:
        """(n_out, n_in)."""

    @property
    def upper(self) -> Real:
        """(n_out, n_in)."""


def modal_sum(modes: HasModes, laplace: Complex, order: int) -> Complex:
    """s^q [sum_r phi_r l_r' / (s - s_r) + conjugate + v / s^2 + u] (seed, eq. 3.5 to 3.7).

    Args:
        modes: what is summed.
        laplace: s of every line [rad/s]; (n_freq,).
        order: q: 0, 1, 2 for receptance, mobility, accelerance.

    Returns:
        FRFs; (n_freq, n_out, n_in).
    """
    residues = modes.shapes[:, None, :] * modes.participation
    s = laplace[:, None]
    power = s**order
    curves = [power / (s - modes.poles), power / (s - modes.poles.conj()), power]
    factors = [residues, residues.conj(), modes.upper[:, :, None]]
    if modes.lower.any():  # else a line at 0 Hz would be none
        curves.append(s ** (order - 2))
        factors.append(modes.lower[:, :, None])
    whole = np.concatenate(factors, axis=2)
    values: Complex = np.hstack(curves) @ whole.reshape(-1, whole.shape[2]).T
    return values.reshape(len(laplace), *whole.shape[:2])


def drive_point_scale(driven: Complex, participation: Complex) -> Complex:
    """Scaling a_r of receptance with phi_ir phi_or / a_r = l_ri phi_or (seed, eq. 3.7).

    From all drive points d together: a_r = phi_d^H phi_d / phi_d^H l_d.

    Args:
        driven: phi_d, shapes at the drive points; (n_drive, n_mode).
        participation: l_d; likewise.

    Returns:
        a_r; (n_mode,).
    """
    size = (np.abs(driven) ** 2).sum(axis=0)
    scale: Complex = size / (driven.conj() * participation).sum(axis=0)
    return scale


@dataclass(frozen=True, eq=False)
class ModalModel(HasPoles):
    """Modes of a machine, as measured or as modelled.

    The receptance between output o and input i is sum_r phi_or l_ri / (s - s_r) + conjugate
    + v_oi / s^2 + u_oi, s = i w, convention exp(+i w t).

    Args:
        poles: s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4) [rad/s]; (n_mode,).
        shapes: phi_r; (n_out, n_mode).
        participation: l_r; (n_in, n_mode).
        lower: residual v of modes below the band; (n_out, n_in).
        upper: residual u of modes above the band; (n_out, n_in).
        outputs: of the shapes; n_out.
        inputs: of the participation; n_in.
        freq_sd: standard deviations of the natural frequencies [Hz]; (n_mode,).
        damping_sd: of the damping ratios; (n_mode,).

    Raises:
        ValueError: shapes that contradict this.
    """

    poles: Complex
    shapes: Complex
    participation: Complex
    lower: Real
    upper: Real
    outputs: tuple[Dof, ...]
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
            object.__setattr__(self, name, frozen(getattr(self, name), kind, shape, name))
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "inputs", tuple(self.inputs))

    @property
    def drive_points(self) -> tuple[Complex, Complex]:
        """Shapes and participation at the inputs that are outputs too; (n_drive, n_mode) each."""
        where: dict[Input, int] = {dof.positive: row for row, dof in enumerate(self.outputs)}
        columns = [k for k, dof in enumerate(self.inputs) if dof.positive in where]
        rows = [where[self.inputs[k].positive] for k in columns]
        pairs = zip(rows, columns, strict=True)
        signs = np.array([self.outputs[row].sign * self.inputs[k].sign for row, k in pairs])
        return self.shapes[rows] * signs[:, None], self.participation[columns]

    @property
    def modal_a(self) -> Complex:
        """Scaling a_r of receptance, from all drive points together (seed, eq. 3.7).

        Raises:
            UsageError: no drive point.
        """
        driven, participation = self.drive_points
        if not len(driven):
            raise UsageError(
                "no input is measured as an output too: without a drive point modes have no scale"
            )
        return drive_point_scale(driven, participation)

    def synthesise(self, freq_hz: Real, quantity: Quantity) -> Frf:
        """FRFs from every input to every output (seed, eq. 3.5 to 3.7), residuals included.

        Args:
            freq_hz: [Hz]; (n_freq,); above 0 Hz where a residual of lower modes is there.
            quantity: of the FRFs.
        """
        laplace = np.asarray(2j * np.pi * np.asarray(freq_hz), np.complex128)
        values = modal_sum(self, laplace, ORDER[quantity])
        return Frf(np.asarray(freq_hz), values, self.outputs, self.inputs, quantity)
