r"""Mass from rigid modes: what an unconstrained model weighs, though nobody says so.

Shapes normalised by mass have psi' M psi = 1. Of a translation psi_t, the same at every point,

    m = 1 / (psi_t' psi_t)                                              (eq. 20 to 23)

but a solver gives six mixtures of translations and turns. All six rigid modes move as
u(r) = t + w x (r - c), so that with A their six columns (t, w) about c, A' M_6 A = 1 and

    M_6 = (A A')^-1

is the whole 6 x 6 mass of the body about c: mass, centre of mass, inertia, however they mix. With
one free translation mode alone, eq. 23 holds as printed. Shapes that are not normalised by mass
give an M_6 that no body has: another mass along each axis, or turns as if all mass lay at the
body's very ends (as it does if each shape's largest displacement is one).

A rigid shape has a frequency of its own where mounts hold the body: it is a mode like any other.
What nothing holds lies at zero, or at what rounding makes of it.
"""

from dataclasses import dataclass

import numpy as np

from identification.shapes.fe_shapes import Shapes
from identification.words import InputError, Mask, Real

_RIGID = 0.01  # of its motion, what a rigid mode may deform
_STILL = 0.05  # of a translation, what a mode may turn at the mesh's ends and still be one
_DOUBTFUL = 0.02  # of its diagonal: products of rigid modes in a mass that is none
_ENDS = 0.95  # of the body's ends, where no radius of gyration lies
_ZERO = 1e-3  # of the highest frequency: below it no mode deforms that anything holds
_LOOSE = 0.05  # of the lowest of these: what nothing holds


@dataclass(frozen=True, eq=False)
class RigidModes:
    """Rigid modes of a model, and what they say of its mass.

    Args:
        modes: which are rigid in shape; (n_mode,).
        held: which have a frequency of their own; (n_mode,).
        deformation: of each mode, rms part of its motion that is not rigid; (n_mode,).
        mass: of the body [kg]; None if fewer than six modes are rigid and none is a translation.
        by_translation: by eq. 23 from each mode that is a translation [kg]; may be empty.
        centre: of mass [m]; None without six modes; (3,).
        inertia: about the centre of mass [kg m2]; None without six modes; (3, 3).
        asymmetry: of the mass block of M_6, which is m times 1 in a mass-normalised model; 0 there.
        reach: largest radius of gyration, of the farthest point from its axis; 0 without six modes.
    """

    modes: Mask
    held: Mask
    deformation: Real
    mass: float | None
    by_translation: tuple[float, ...]
    centre: Real | None
    inertia: Real | None
    asymmetry: float
    reach: float

    @property
    def normalised(self) -> bool:
        """Whether the shapes are normalised by mass, as far as six modes tell."""
        return self.asymmetry < _DOUBTFUL and self.reach < _ENDS


def rigid_modes(shapes: Shapes) -> RigidModes:
    """Find the rigid modes and weigh the body by them.

    Args:
        shapes: of an unconstrained model, normalised by mass.

    Raises:
        InputError: a shape that deforms at rest beside a rigid one that is held: the frequencies
            are those of other shapes.
    """
    middle = shapes.points.mean(axis=0)
    arms = shapes.points - middle
    motions, left = _moved(arms, shapes.vectors)
    rigid = left < _RIGID
    held = _held(shapes, rigid)
    scale = float(np.sqrt((arms**2).sum(axis=1).mean()))
    found = motions[:, rigid]
    translations = np.linalg.norm(found[:3], axis=0)
    turns = scale * np.linalg.norm(found[3:], axis=0)
    alone = turns < _STILL * translations
    by_translation = tuple((1 / translations[alone] ** 2).tolist())
    if rigid.sum() != 6:
        mass = float(np.mean(by_translation)) if by_translation else None
        return RigidModes(rigid, held, left, mass, by_translation, None, None, 0.0, 0.0)
    whole = np.linalg.inv(found @ found.T)
    block = whole[:3, :3]
    mass = float(np.trace(block) / 3)
    asymmetry = float(np.abs(block - mass * np.eye(3)).max() / mass)
    # M_6 about c holds m [s]x' in its corner, s from c to the centre of mass.
    corner = (whole[3:, :3] - whole[3:, :3].T) / 2 / mass
    arm = np.array([corner[2, 1], corner[0, 2], corner[1, 0]])
    inertia = whole[3:, 3:] - mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    centre = middle + arm
    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    far = np.linalg.norm(np.cross(shapes.points[:, None] - centre, axes.T), axis=2).max(axis=0)
    reach = float((np.sqrt(np.maximum(moments, 0.0) / mass) / np.maximum(far, 1e-300)).max())
    return RigidModes(rigid, held, left, mass, by_translation, centre, inertia, asymmetry, reach)


def _held(shapes: Shapes, rigid: Mask) -> Mask:
    """Which modes have a frequency of their own."""
    freq = shapes.frequencies
    deforming = freq[~rigid & (freq > _ZERO * freq.max(initial=0.0))]
    lowest = float(deforming.min()) if deforming.size else float(freq.max(initial=0.0))
    held: Mask = freq > _LOOSE * lowest
    loose, firm = np.flatnonzero(~held & ~rigid), np.flatnonzero(held & rigid)
    if len(loose) and len(firm):
        raise InputError(
            f"{shapes.source}: a shape that deforms is at {freq[loose[0]]:.4g} Hz, one that is "
            f"rigid at {freq[firm[0]]:.4g} Hz: the frequencies do not fit the shapes. Give them in "
            "the order of the shapes."
        )
    return held


def check_mass(found: RigidModes, stated: float, within: float, source: str) -> None:
    """Compare with a stated mass.

    Args:
        found: what rigid modes say.
        stated: what the structure weighs [kg].
        within: part by which both may differ.
        source: of the shapes, for the message.

    Raises:
        InputError: no mass can be told, or another one.
    """
    if found.mass is None:
        raise InputError(
            f"{source}: {int(found.modes.sum())} modes are rigid and none is a translation alone, "
            "so that its mass cannot be told. Solve it unconstrained, with all six rigid modes."
        )
    if not found.normalised:
        raise InputError(
            f"{source}: the shapes are not normalised by mass, so that its mass cannot be told. "
            "Write them with unit modal mass."
        )
    if abs(found.mass / stated - 1) > within:
        raise InputError(
            f"{source} weighs {found.mass:.4g} kg by its rigid modes, {stated:.4g} kg was stated. "
            "Correct its densities and added masses, or normalise its shapes by mass."
        )


def _moved(arms: Real, vectors: Real) -> tuple[Real, Real]:
    """Rigid motion (t, w) of each shape by least squares, and what is left of it.

    Args:
        arms: points from the middle; (n_point, 3).
        vectors: (n_mode, n_point, 3).

    Returns:
        (6, n_mode) and, relative, (n_mode,).
    """
    rows = np.zeros((len(arms), 3, 6))
    rows[:, :, :3] = np.eye(3)
    for axis, unit in enumerate(np.eye(3), start=3):
        rows[:, :, axis] = np.cross(unit, arms)
    table, flat = rows.reshape(-1, 6), vectors.reshape(len(vectors), -1).T
    motion = np.asarray(np.linalg.lstsq(table, flat, rcond=None)[0], float)
    size = np.linalg.norm(flat, axis=0)
    left = np.linalg.norm(flat - table @ motion, axis=0) / np.where(size > 0, size, 1.0)
    return motion, left
