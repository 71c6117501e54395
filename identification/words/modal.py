"""A modal model: poles, shapes and their scaling, with what lies beside the band."""

from dataclasses import dataclass

import numpy as np

from identification.words._arrays import Complex, Real, frozen
from identification.words.dof import Dof
from identification.words.errors import UsageError
from identification.words.frf import ORDER, Frf, Quantity
from identification.words.motor import Input


@dataclass(frozen=True, eq=False)
class ModalModel:
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
    def freq_hz(self) -> Real:
        """Natural frequencies |s_r| / 2 pi [Hz]; (n_mode,)."""
        frequency: Real = np.abs(self.poles) / (2 * np.pi)
        return frequency

    @property
    def damping(self) -> Real:
        """Damping ratios -Re s_r / |s_r|; (n_mode,)."""
        ratio: Real = -self.poles.real / np.abs(self.poles)
        return ratio

    @property
    def modal_a(self) -> Complex:
        """Scaling a_r of receptance with phi_ir phi_or / a_r = l_ri phi_or (seed, eq. 3.7).

        From the drive points, the inputs that are outputs too, together: a_r = phi_d^H phi_d /
        phi_d^H l_d.

        Raises:
            UsageError: no drive point.
        """
        where = {dof.positive: row for row, dof in enumerate(self.outputs)}
        pairs = [
            (where[dof.positive], column, self.outputs[where[dof.positive]].sign * dof.sign)
            for column, dof in enumerate(self.inputs)
            if isinstance(dof, Dof) and dof.positive in where
        ]
        if not pairs:
            raise UsageError(
                "no input is measured as an output too: without a drive point modes have no scale"
            )
        rows, columns, signs = (np.array(part) for part in zip(*pairs, strict=True))
        driven = self.shapes[rows] * signs[:, None]
        scale: Complex = (np.abs(driven) ** 2).sum(axis=0) / (
            driven.conj() * self.participation[columns]
        ).sum(axis=0)
        return scale

    def synthesise(self, freq_hz: Real, quantity: Quantity) -> Frf:
        """FRFs from every input to every output (seed, eq. 3.5 to 3.7), residuals included.

        Args:
            freq_hz: [Hz]; (n_freq,); above 0 Hz where a residual of lower modes is there.
            quantity: of the FRFs.
        """
        s = 2j * np.pi * np.asarray(freq_hz)[:, None, None]
        residues = self.shapes[:, None, :] * self.participation
        away, twin = 1 / (s[:, 0] - self.poles), 1 / (s[:, 0] - self.poles.conj())
        total = np.tensordot(away, residues, (1, 2)) + np.tensordot(twin, residues.conj(), (1, 2))
        order = ORDER[quantity]
        values = s**order * (total + self.upper)
        if self.lower.any():
            values = values + s ** (order - 2) * self.lower
        return Frf(np.asarray(freq_hz), values, self.outputs, self.inputs, quantity)
