"""The vertical joint of one mass (``nonlinear_mass``), as a diagnosis describes it."""

import numpy as np

from diagnosis.hypothesis import JointDirection
from diagnosis.levels.joint_transient import JointTransient
from mbmodel.assembly import Matrices
from tests.helpers.nonlinear_mass import DAMPING, FREQ_HZ, MASS_KG, STIFFNESS

JOINT = JointDirection("block", "tz", "block_tz")
LEVELS = (20.0, 115.0, 270.0)


def build_transient(damping: float = DAMPING) -> JointTransient:
    """Return the free motion of the mass at its joint."""
    unit = np.ones((1, 1))
    matrices = Matrices(MASS_KG * unit, damping * unit, STIFFNESS * unit)
    return JointTransient.of_matrices(matrices, np.ones(1), unit, FREQ_HZ)
