"""Shapes of modes that lie too close for their poles to be told apart.

The measured columns of m poles within each other's uncertainty are, with their common pole s_0,

    H(s) = R_0 / (s - s_0) + R_1 / (s - s_0)^2 + ...,  R_k = sum_r phi_r l_r^T (s_r - s_0)^k.

The sum R_0 is well determined, but how it splits into the products phi_r l_r^T is not: any split
that noise favours may stand there. With reciprocity, R_0 = Phi Phi_d^T / a with a = 2 i w_d * 1 kg
and Phi_d the shapes at the drive points d. The matrix a R_0 at the drive points is therefore
symmetric, and its factorisation F F^T (Takagi; for real modes its eigenvectors times the roots of
its eigenvalues) gives Phi = a R_0 F^-T, up to a rotation of the modes among themselves. The
rotation follows from R_1 = Phi diag(s_r - s_0) Phi_d^T / a. If the poles are equal, it is arbitrary
and leaves all FRFs unchanged. This is the decomposition of a residue matrix of repeated roots by
its rank (Ewins 2000, ch. 4.6), with mass-normalised shapes.
"""

from dataclasses import replace

import numpy as np

from identification.words import Complex, ModalModel, Real

# Distance of two poles over the sum of their half-power half-widths, at most: R_k beyond R_1 are
# then below 4 % of R_1, and R_0 is exact anyway.
_MAX_CLOSE_POLE_DISTANCE = 0.2
# The relative error of the residues of two close poles is about the standard deviation of their
# distance over the distance. A tenth of one per cent leaves room for errors of the model, which
# the standard deviations do not include.
_MAX_RESIDUE_ERROR = 0.001
# Smallest singular value of the residues at the drive points over their asymmetry, which is error
# alone: below, they show fewer modes than poles. And the same over the largest singular value.
_MIN_RESIDUE_OVER_ERROR = 3.0
_MIN_RELATIVE_RESIDUE = 1e-9
# Standard deviation of a pole whose distance from another counts as known exactly, relative to it.
_POLE_ROUNDING = 1e-9


def group_close_poles(model: ModalModel) -> tuple[tuple[int, ...], ...]:
    """Return the groups of poles whose distances their standard deviations do not determine.

    Args:
        model: modal model with standard deviations of its poles.

    Returns:
        Groups of two or more modes, each with rising numbers.
    """
    poles = model.poles
    sd = 2 * np.pi * np.hypot(model.freq_sd, model.freq_hz * model.damping_sd)
    sd = np.maximum(sd, _POLE_ROUNDING * np.abs(poles))
    distance = np.abs(poles[:, None] - poles)
    half_width = np.abs(poles.real)
    is_close = distance < _MAX_CLOSE_POLE_DISTANCE * (half_width[:, None] + half_width)
    is_close &= _MAX_RESIDUE_ERROR * distance < sd[:, None] + sd
    groups: list[tuple[int, ...]] = []
    free = set(range(len(poles)))
    while free:
        group, edge = set(), {min(free)}
        while edge:
            group |= edge
            edge = {int(k) for mode in edge for k in np.flatnonzero(is_close[mode])} - group
        free -= group
        if len(group) > 1:
            groups.append(tuple(sorted(group)))
    return tuple(groups)


def separate_close_modes(model: ModalModel, driven: Complex, participation: Complex) -> ModalModel:
    """Replace the shapes of close modes by those whose products give the measured residues.

    Groups of more poles than drive points stay as they are, and so do groups whose residues at the
    drive points show fewer modes.

    Args:
        model: modal model, any scaling.
        driven: shapes at the drive points, linear in the shapes; (n_drive, n_mode).
        participation: participation at the drive points; (n_drive, n_mode).

    Returns:
        The model; in the groups, shapes are those of unit modal mass, participation is reciprocal,
            and poles are those of R_0 and R_1.
    """
    for group in group_close_poles(model):
        modes = list(group)
        if len(modes) > len(driven):
            continue
        split = _split_residue(model, driven[:, modes], participation[:, modes], modes)
        if split is None:
            continue
        poles, shapes, rows = model.poles.copy(), model.shapes.copy(), model.participation.copy()
        poles[modes], shapes[:, modes], rows[:, modes] = split
        model = replace(model, poles=poles, shapes=shapes, participation=rows)
    return model


def _split_residue(
    model: ModalModel, driven: Complex, participation: Complex, modes: list[int]
) -> tuple[Complex, Complex, Complex] | None:
    """Return poles, shapes and participation of one group; None if its residues show fewer modes.

    Args:
        driven: shapes of the group at the drive points; (n_drive, n).
        participation: its participation there; (n_drive, n).
        modes: numbers of its modes.
    """
    shapes, rows = model.shapes[:, modes], model.participation[:, modes]
    weight = np.linalg.norm(shapes, axis=0) * np.linalg.norm(rows, axis=0)
    centre = complex((weight * model.poles[modes]).sum() / weight.sum())
    if not np.isfinite(centre):
        return None
    offset, scale = model.poles[modes] - centre, 2j * centre.imag
    at_drives = scale * driven @ participation.T
    error = float(np.linalg.norm(at_drives - at_drives.T, 2)) / 2
    size = np.linalg.svd(at_drives, compute_uv=False)[: len(modes)]
    if size[-1] < max(_MIN_RESIDUE_OVER_ERROR * error, _MIN_RELATIVE_RESIDUE * size[0]):
        return None
    factor = factor_symmetric((at_drives + at_drives.T) / 2, len(modes))
    inverse = np.linalg.pinv(factor)
    at_drives = np.asarray(scale * (driven * offset) @ participation.T, complex)
    moment: Complex = np.asarray(inverse @ at_drives @ inverse.T, complex)
    rotation = _common_rotation((moment + moment.T) / 2)
    moved = np.diag(rotation.T @ moment @ rotation)
    new_poles = centre + moved
    if not (new_poles.real < 0).all() or not (new_poles.imag > 0).all():
        new_poles = np.full(len(modes), centre)
    # Phi = a R_0 F^-T, and l such that Phi l^T = R_0 in every measured column.
    unit_mass = scale * shapes @ (participation.T @ inverse.T) @ rotation
    columns = np.linalg.pinv(unit_mass) @ shapes @ rows.T
    return new_poles, np.asarray(unit_mass, complex), np.asarray(columns.T, complex)


def factor_symmetric(matrix: Complex, rank: int) -> Complex:
    """Factor a complex symmetric matrix M = F F^T by Takagi's factorisation, of a given rank.

    The singular value decomposition M = U S V^H gives F = U S^1/2 Z^1/2, with Z = U^H V* unitary
    and block diagonal for equal singular values, which the unitary square root respects.

    Args:
        matrix: M; (n, n).
        rank: number of columns of F, the largest.

    Returns:
        F; (n, rank). For a real M without negative eigenvalues it is real.
    """
    left, size, right = np.linalg.svd(matrix)
    left, right = left[:, :rank], right[:rank].T
    phase = left.conj().T @ right
    # The polar factor is the nearest unitary matrix; its root keeps to the principal branch.
    outer, _, inner = np.linalg.svd(phase)
    unitary = outer @ inner
    values, vectors = np.linalg.eig(unitary)
    root = vectors @ np.diag(np.sqrt(values)) @ np.linalg.inv(vectors)
    return left @ np.diag(np.sqrt(size[:rank])) @ root


def _common_rotation(moment: Complex) -> Real:
    """Return the real rotation that makes a complex symmetric matrix most nearly diagonal; (n, n).

    For real modes real and imaginary part have the same eigenvectors. They are taken at the phase
    at which the part that differs between modes is largest.
    """
    deviator = moment - np.trace(moment) / len(moment) * np.eye(len(moment))
    phase = np.angle((deviator**2).sum()) / 2
    return np.asarray(np.linalg.eigh((deviator * np.exp(-1j * phase)).real)[1], np.float64)
