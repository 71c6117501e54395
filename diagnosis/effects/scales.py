"""Units and limits of the parameters of effects.

A fit moves a coordinate without a prior by at most 0.7 units a step (``tuning.solvers``). One unit
is therefore a small change of any machine, whatever its size.
"""

import numpy as np

from diagnosis.rounding import NEGLIGIBLE_SHARE

MASS_SHARE_UNIT = 0.01  # of the body's mass
ARM_UNIT_M = 0.1  # m, of a place, a point or an offset
LOG_FREQUENCY_UNIT = 0.05  # of the logarithm, and of its scan: less than a resonance is wide
LOG_UNIT = 0.5  # of the logarithm of a time constant or a damping ratio
# Units of a logarithm: beyond a ratio that counts as nothing, FRFs in the band change no more.
MAX_LOG_STEPS = -float(np.log(NEGLIGIBLE_SHARE)) / LOG_UNIT
