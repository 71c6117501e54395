r"""Comparison of a model's mass by its rigid modes with the mass of the structure.

The match of shapes at sensors needs no mass, so that a difference is a remark on the model and not
a reason to refuse it. It matters for the frequencies: if a mass m lacks everywhere in proportion,
omega_r^2 = psi_r' K psi_r / (psi_r' M psi_r) scales every frequency by sqrt(m_model / m). The
gondola's paper asks for this check (eqs. 20 to 23, "Mass Consistency").
"""

from dataclasses import dataclass

import numpy as np

from identification.shapes.rigid_mass import RigidModes


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
