"""Units and limits of the parameters of effects.

A fit moves a coordinate without a prior by at most 0.7 units a step (``tuning.solvers``). One unit
is therefore a small change of any machine, whatever its size.
"""

MASS_SHARE_UNIT = 0.01  # of the body's mass
ARM_UNIT_M = 0.1  # m, of a place, a point or an offset
LOG_UNIT = 0.5  # of the logarithm of a time constant or a damping ratio
MAX_LOG_STEPS = 20.0  # units of a logarithm: beyond, FRFs in the band change no more
