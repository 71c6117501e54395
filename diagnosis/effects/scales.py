"""Units of the parameters of effects: a step of one is small for a machine, whatever its size."""

MASS_SHARE_UNIT = 0.01  # of the body's mass
ARM_UNIT_M = 0.1  # m, of a place or point
LOG_TIME_UNIT = 0.5  # of the logarithm of a time constant or a damping ratio
MAX_LOG_STEPS = 20.0  # units of a logarithm: beyond, FRFs in the band change no more
# Rows and columns of the entries of a symmetric 3 x 3 matrix: xx, yy, zz, yz, xz, xy.
SYMMETRIC_ENTRIES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
