r"""Sign of the residues at drive points.

A force feeds no negative power into a passive structure at its own point. Near a lightly damped
resonance the receptance there is R / (s - s_r) with R = phi^2 / (2 i w_d m), so that -Im R is
positive in every mode (Ewins 2000, ch. 2). A negative one means that force and motion are not those
of one point and direction in that mode: the sensor stands across a node from the hammer, or the
sign of the channel is wrong there.
"""

import numpy as np

from identification.words import Complex, Mask, ModalModel, Real

_MIN_RESIDUE_DEVIATIONS = 5.0  # standard deviations of a residue whose sign is clear
_MIN_PHASE_SHARE = 0.8  # |Im R| over |R|: modes that overlap have residues of any phase
# Residue over the largest of the drive point, in amplitude at resonance: smaller ones are those of
# points near a node, where a small distance between hammer and sensor turns the sign.
_MIN_DRIVE_RESIDUE_SHARE = 0.02
_MIN_POWER_SHARE = 0.5  # negative power of all modes at a resonance over that of the mode alone


def find_negative_residues(
    poles: Complex, residues: Complex, deviations: Real, inside: Mask
) -> tuple[int, ...]:
    """Return the modes with a negative residue at a drive point, beside modes with a positive one.

    If all are negative, a direction is reversed, which the power of the whole band shows.

    Args:
        poles: s_r [rad/s]; (n_mode,).
        residues: residues of receptance at the drive point; (n_mode,).
        deviations: their standard deviations; (n_mode,).
        inside: modes of the band; (n_mode,).
    """
    size = np.abs(residues)
    if not inside.any():
        return ()
    amplitude = size * np.abs(poles) / np.maximum(np.abs(poles.real), np.finfo(float).tiny)
    clear = inside & (size > _MIN_RESIDUE_DEVIATIONS * deviations)
    clear &= np.abs(residues.imag) > _MIN_PHASE_SHARE * size
    clear &= amplitude > _MIN_DRIVE_RESIDUE_SHARE * amplitude[inside].max()
    if not (clear & (residues.imag < 0)).any():
        return ()
    # Modes that overlap may have a negative residue, but the power of all modes together may not.
    # Residual terms have no power.
    s = 1j * np.abs(poles)[:, None]
    terms = residues / (s - poles) + residues.conj() / (s - poles.conj())
    power, alone = (s * terms).real.sum(axis=1), np.diag(s * terms).real
    clear &= power < _MIN_POWER_SHARE * alone
    return tuple(int(k) for k in np.flatnonzero(clear & (residues.imag > 0)))


def negative_drive_points(
    model: ModalModel, residue_sd: Real, inside: Mask
) -> dict[str, tuple[int, ...]]:
    """Return the modes with a negative residue at each drive point that has any.

    Args:
        residue_sd: standard deviations of the residues; (n_out, n_in, n_mode).
        inside: modes of the band; (n_mode,).
    """
    rows = {dof.positive: row for row, dof in enumerate(model.outputs)}
    negative = {}
    for column, dof in enumerate(model.inputs):
        row = rows.get(dof.positive)
        if row is None:
            continue
        sign = dof.sign * model.outputs[row].sign
        residues = sign * model.shapes[row] * model.participation[column]
        modes = find_negative_residues(model.poles, residues, residue_sd[row, column], inside)
        if modes:
            negative[str(dof)] = modes
    return negative


def negative_residue_phrase(point: str) -> str:
    """Say that the residue of a mode has the wrong sign at a drive point.

    Args:
        point: label of the drive point.
    """
    return (
        f"at the drive point {point} its residue has the wrong sign, as if the hammer took power "
        "out of the machine: check that hammer and sensor are at one point"
    )
