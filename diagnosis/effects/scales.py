"""Units and limits of the parameters of effects.

A fit moves a coordinate without a prior by at most 0.7 units a step (``tuning.solvers``). One unit
is therefore a small change of any machine, whatever its size.
"""

import numpy as np

from diagnosis.settings import NEGLIGIBLE_SHARE

MASS_SHARE_UNIT = 0.01  # of the body's mass
ARM_UNIT_M = 0.1  # m, of a place, a point or an offset
LOG_FREQUENCY_UNIT = 0.05  # of the logarithm, and of its scan: less than a resonance is wide
# A range switch that is off by a decade, or g read as m/s^2, and a fifth beyond: a channel with
# less or more is dead, exchanged with another or of another unit.
GAIN_ENDS = 1 / 12, 12.0
LOG_UNIT = 0.5  # of the logarithm of a time constant or a damping ratio
# Units of a logarithm: beyond a ratio that counts as nothing, FRFs in the band change no more.
MAX_LOG_STEPS = -float(np.log(NEGLIGIBLE_SHARE)) / LOG_UNIT
