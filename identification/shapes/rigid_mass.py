r"""Mass, centre of mass and inertia of an unconstrained finite-element model from its rigid modes.

Shapes normalised by mass have psi' M psi = 1. For a translation psi_t with one motion at every
point,

    m = 1 / (psi_t' psi_t)                                              (eq. 20 to 23)

but a solver gives six mixtures of translations and rotations. All six rigid modes move as u(r) = t
+ w x (r - c). With A their six columns (t, w) about ``c``, A' M_6 A = 1 and

    M_6 = (A A')^-1

is the whole 6 x 6 mass matrix of the body about ``c``, for any mixture: mass, centre of mass,
inertia. With a single free translation mode, eq. 23 holds as printed. Shapes that are not
normalised by mass give an M_6 that no body has. Its mass differs between axes, or its radius of
gyration reaches the ends of the body, as it does if the largest displacement of each shape is one.

A rigid shape has a non-zero frequency if mounts support the body; it is then a mode like any other.
An unsupported rigid mode has the frequency zero, apart from rounding.

Comparison of a model's mass by its rigid modes with the mass of the structure.

The match of shapes at sensors needs no mass, so that a difference is a remark on the model and not
a reason to refuse it. It matters for the frequencies: if a mass m lacks everywhere in proportion,
omega_r^2 = psi_r' K psi_r / (psi_r' M psi_r) scales every frequency by sqrt(m_model / m). The
gondola's paper asks for this check (eqs. 20 to 23, "Mass Consistency").
"""

from dataclasses import dataclass

import numpy as np

from identification.shapes.fe_file import Shapes
from identification.words import InputError, Mask, Real

# Rms deformation of a rigid mode over its rms motion, at most.
_MAX_DEFORMATION = 0.01
# Rms motion by rotation of a translation mode over its translation, at most.
_MAX_ROTATION_SHARE = 0.05
# Deviation of the mass block from a multiple of the identity, relative to the mass, at most.
_MAX_ASYMMETRY = 0.02
# Radius of gyration over the distance of the farthest point, at most: one would need all the mass
# at the ends of the body.
_MAX_GYRATION_SHARE = 0.95
# Frequency over the highest below which a deforming mode is a mechanism or rounding.
_MIN_FREQUENCY_SHARE = 1e-3
# Frequency over the lowest elastic one below which a mode has no support.
_MAX_FREE_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class RigidModes:
    """Rigid modes of a model, and the mass properties that follow from them.

    Args:
        is_rigid: which modes are rigid in shape; (n_mode,).
        supported: which modes have a non-zero frequency; (n_mode,).
        deformation: rms part of each mode's motion that is not rigid; (n_mode,).
        mass: mass of the body [kg]; None if fewer than six modes are rigid and none is a
            translation.
        by_translation: mass by eq. 23 from each mode that is a translation [kg]; may be empty.
        centre: centre of mass [m]; None without six modes; (3,).
        inertia: inertia about the centre of mass [kg m2]; None without six modes; (3, 3).
        asymmetry: deviation of the mass block of M_6 from m times 1, relative to m; 0 in a
            mass-normalised model.
        reach: largest radius of gyration over the distance of the farthest point from its axis; 0
            without six modes.
    """

    is_rigid: Mask
    supported: Mask
    deformation: Real
    mass: float | None
    by_translation: tuple[float, ...]
    centre: Real | None
    inertia: Real | None
    asymmetry: float
    reach: float

    @property
    def is_mass_normalised(self) -> bool:
        """Whether the shapes are normalised by mass, as far as six modes can show."""
        return self.asymmetry < _MAX_ASYMMETRY and self.reach < _MAX_GYRATION_SHARE


def rigid_modes(shapes: Shapes) -> RigidModes:
    """Find the rigid modes and compute the mass properties of the body from them.

    Args:
        shapes: shapes of an unconstrained model, normalised by mass.

    Raises:
        InputError: an unsupported shape that deforms beside a supported rigid one: the frequencies
            belong to other shapes.
    """
    middle = shapes.points.mean(axis=0)
    arms = shapes.points - middle
    motions, deformation = _fit_rigid_motions(arms, shapes.vectors)
    is_rigid = deformation < _MAX_DEFORMATION
    supported = _find_supported(shapes, is_rigid)
    radius = float(np.sqrt((arms**2).sum(axis=1).mean()))
    rigid_motions = motions[:, is_rigid]
    translations = np.linalg.norm(rigid_motions[:3], axis=0)
    turns = radius * np.linalg.norm(rigid_motions[3:], axis=0)
    is_translation = turns < _MAX_ROTATION_SHARE * translations
    by_translation = tuple((1 / translations[is_translation] ** 2).tolist())
    if is_rigid.sum() != 6:
        mass = float(np.mean(by_translation)) if by_translation else None
        return RigidModes(
            is_rigid, supported, deformation, mass, by_translation, None, None, 0.0, 0.0
        )
    mass_matrix = np.linalg.inv(rigid_motions @ rigid_motions.T)
    mass_block = mass_matrix[:3, :3]
    mass = float(np.trace(mass_block) / 3)
    asymmetry = float(np.abs(mass_block - mass * np.eye(3)).max() / mass)
    # M_6 about c holds m [s]x' in its corner, where s points from c to the centre of mass.
    corner = (mass_matrix[3:, :3] - mass_matrix[3:, :3].T) / 2 / mass
    arm = np.array([corner[2, 1], corner[0, 2], corner[1, 0]])
    inertia = mass_matrix[3:, 3:] - mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    centre = middle + arm
    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    far = np.linalg.norm(np.cross(shapes.points[:, None] - centre, axes.T), axis=2).max(axis=0)
    reach = float((np.sqrt(np.maximum(moments, 0.0) / mass) / np.maximum(far, 1e-300)).max())
    return RigidModes(
        is_rigid, supported, deformation, mass, by_translation, centre, inertia, asymmetry, reach
    )


def _find_supported(shapes: Shapes, rigid: Mask) -> Mask:
    """Return which modes have a non-zero frequency; (n_mode,)."""
    freq = shapes.frequencies
    deforming = freq[~rigid & (freq > _MIN_FREQUENCY_SHARE * freq.max(initial=0.0))]
    lowest = float(deforming.min()) if deforming.size else float(freq.max(initial=0.0))
    supported: Mask = freq > _MAX_FREE_SHARE * lowest
    free, rigid_supported = np.flatnonzero(~supported & ~rigid), np.flatnonzero(supported & rigid)
    if len(free) and len(rigid_supported):
        raise InputError(
            f"{shapes.source}: a shape that deforms is at {freq[free[0]]:.4g} Hz, one that is "
            f"rigid at {freq[rigid_supported[0]]:.4g} Hz: the frequencies do not fit the shapes. "
            "Give them in the order of the shapes."
        )
    return supported


def _fit_rigid_motions(arms: Real, vectors: Real) -> tuple[Real, Real]:
    """Fit a rigid motion (t, w) to each shape by least squares.

    Args:
        arms: points from the middle; (n_point, 3).
        vectors: (n_mode, n_point, 3).

    Returns:
        Motions, (6, n_mode), and the rms of the residual relative to the shape, (n_mode,).
    """
    rows = np.zeros((len(arms), 3, 6))
    rows[:, :, :3] = np.eye(3)
    for axis, unit in enumerate(np.eye(3), start=3):
        rows[:, :, axis] = np.cross(unit, arms)
    table, flat = rows.reshape(-1, 6), vectors.reshape(len(vectors), -1).T
    motion = np.asarray(np.linalg.lstsq(table, flat, rcond=None)[0], float)
    size = np.linalg.norm(flat, axis=0)
    residual = np.linalg.norm(flat - table @ motion, axis=0) / np.where(size > 0, size, 1.0)
    return motion, residual


@dataclass(frozen=True)
class MassCheck:
    """Mass of a model beside the mass of the structure.

    Args:
        stated: mass of the structure [kg].
        tolerance: largest difference that is no mismatch [kg].
        simulated: mass of the model by its rigid modes [kg]; None if they do not show it.
        reason: why the mass of the model is unknown; empty if it is known.
    """

    stated: float
    tolerance: float
    simulated: float | None
    reason: str = ""

    @property
    def agrees(self) -> bool | None:
        """Whether both masses agree within the tolerance; None if one is unknown."""
        if self.simulated is None:
            return None
        return abs(self.simulated - self.stated) <= self.tolerance

    def remark(self, source: str) -> str:
        """Return the comparison in one sentence.

        Args:
            source: file of the shapes.
        """
        stated = f"{self.stated:.4g} +- {self.tolerance:.3g} kg"
        if self.simulated is None:
            return f"{source} cannot be compared with the stated {stated}: {self.reason}"
        if self.agrees:
            return f"{source} weighs {self.simulated:.4g} kg, within the stated {stated}"
        shift = 100 * (float(np.sqrt(self.simulated / self.stated)) - 1)
        return (
            f"{source} weighs {self.simulated:.4g} kg by its rigid modes, {stated} was stated: "
            "correct its densities and added masses. Spread like its own mass, the difference "
            f"would change its frequencies by {shift:+.1f} %"
        )


def compare_mass(modes: RigidModes, stated: float, tolerance: float) -> MassCheck:
    """Compare the mass by rigid modes with the mass of the structure.

    Args:
        modes: rigid modes of the model.
        stated: mass of the structure [kg].
        tolerance: largest difference that is no mismatch [kg].
    """
    reason = ""
    if modes.mass is None:
        reason = (
            f"{int(modes.is_rigid.sum())} modes are rigid, none is a pure translation; solve it "
            "unconstrained, with all six rigid modes"
        )
    elif not modes.is_mass_normalised:
        reason = "the shapes are not normalised by mass; write them with unit modal mass"
    return MassCheck(stated, tolerance, None if reason else modes.mass, reason)
