"""Largest motion of a mode: whether a named body moves most in a named direction, with slopes.

The kinetic energy of direction k in a mode of shape phi is, with b = T phi and the bodies' mass
matrix Mb of the nominal model (Ewins 2000, ch. 2),

    E_k = Re(conj(b_k) (Mb b)_k).

A named translation competes with all other directions of all bodies. A named rotation competes
with rotations alone: a body that tilts carries the bodies above it along, so that their
translations are part of its motion. The named motion is the largest if its energy E_n, of all named
directions together, exceeds the largest of the others,

    d = ln(E_o / E_n) < 0,    E_o = (sum_k E_k^4)^(1/4),

where the fourth power makes the maximum differentiable and errs to the safe side. Neither the size
nor the phase of phi changes d.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Dof, Integers, Real

_POWER_OF_MAXIMUM = 4
_MIN_ENERGY_SHARE = 1e-9  # of a mode's energy: less does not move, and has no logarithm


@dataclass(frozen=True, eq=False)
class NamedMotion:
    """Directions of a body that move most in a mode, and the directions that compete with them.

    Args:
        named: numbers of the named directions among the labels; (n_named,).
        competing: numbers of all other directions, for rotations those that are rotations too;
            (n_competing,).
    """

    named: Integers
    competing: Integers

    def excess(self, energies: Real) -> Real:
        """Return d of each mode: negative where the named motion is the largest; (n_mode,).

        Args:
            energies: kinetic energy of every direction; (n_label, n_mode).
        """
        floor = _MIN_ENERGY_SHARE * np.abs(energies).sum(axis=0)
        named = np.maximum(energies[self.named].sum(axis=0), floor)
        competing = np.maximum(energies[self.competing], floor)
        size = competing.max(axis=0, initial=0.0)
        if not len(self.competing):  # one body that can move in one way only
            return np.full(energies.shape[1], -np.inf)
        powers = ((competing / size) ** _POWER_OF_MAXIMUM).sum(axis=0)
        return np.log(size / named) + np.log(powers) / _POWER_OF_MAXIMUM

    def leads(self, energies: Real) -> bool:
        """Return whether the named motion is the largest of one mode with E; (n_label,)."""
        return bool(energies[self.named].sum() >= energies[self.competing].max(initial=0.0))

    def slope(self, motion: Complex, body_mass: Real) -> Complex:
        """Return W with d(excess) = Re sum conj(W) db of one mode; (n_label,).

        Args:
            motion: b; (n_label,).
            body_mass: Mb; (n_label, n_label).
        """
        momentum = body_mass @ motion
        energies = (motion.conj() * momentum).real
        floor = _MIN_ENERGY_SHARE * np.abs(energies).sum()
        competing = np.maximum(energies[self.competing], floor)
        powers = (competing / competing.max()) ** _POWER_OF_MAXIMUM
        weights = np.zeros(len(motion))
        weights[self.competing] = np.where(
            energies[self.competing] > floor, powers / powers.sum() / competing, 0.0
        )
        named = energies[self.named].sum()
        weights[self.named] = -1.0 / named if named > floor else 0.0
        # dE_k = Re[conj(db_k) (Mb b)_k + conj(b_k) (Mb db)_k]
        return weights * momentum + body_mass.T @ (weights * motion)


def name_motion(labels: Sequence[Dof], body: str, directions: Sequence[str]) -> NamedMotion:
    """Return the named directions of a body with those that compete.

    Args:
        labels: six directions of the centre of mass of every body.
        body: name of a body.
        directions: such as ``tx``; all translations or all rotations.
    """
    is_named = np.array(
        [dof.point == body and dof.direction[1:] in directions for dof in labels], bool
    )
    is_rotation = np.array([dof.is_rotation for dof in labels], bool)
    competes = ~is_named & (is_rotation | (not is_rotation[is_named][0]))
    return NamedMotion(np.flatnonzero(is_named), np.flatnonzero(competes))
