"""The band and the level of a test that fit a machine: its own modes, and its mass."""

from dataclasses import replace

import numpy as np
import scipy.linalg

from truth.campaign.protocol import Protocol
from truth.machine.rig import Prepared, build, null_basis
from truth.machine.station import Real, Station

# A usual station, of this mass, is tested to 200 Hz at 200 N.
_BAND_HZ = 200.0
_MASS_KG = 3735.0
_MODES = 12  # in the band, or half of them
_BEYOND_MODE = 1.2
_COARSE = 8  # lines below the first mode: with fewer the lines are twice as many
_STILL = 1e-4  # of the median mode: below it nothing holds the machine
_DIGITS = 2  # of spacing and level


def natural_frequencies(station: Station) -> Real:
    """Return the undamped natural frequencies [Hz], rising; motions that nothing holds have 0."""
    equations = build(Prepared(station, ())).equations
    basis = null_basis(equations)
    stiffness, mass = (basis.T @ matrix @ basis for matrix in (equations.stiffness, equations.mass))
    values = np.asarray(scipy.linalg.eigvalsh(stiffness, mass), np.float64)
    frequencies: Real = np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)
    return frequencies


def fit_to_machine(protocol: Protocol, station: Station) -> Protocol:
    """Return the test with band, hits and levels that fit a machine.

    The band ends a fifth above the twelfth mode, or the middle one of more than 24, or the last one
    of fewer than 12. Levels grow with the mass, so that all machines are shaken alike.

    Args:
        protocol: for a usual station.
    """
    modes = natural_frequencies(station)
    held = modes[modes > _STILL * np.median(modes)]
    if not held.size:
        return protocol
    top = _BEYOND_MODE * held[min(max(_MODES, held.size // 2), held.size) - 1]
    spacing, lines = protocol.resolution_hz * top / _BAND_HZ, protocol.lines
    if spacing * _COARSE > held[0]:
        spacing, lines = spacing / 2, 2 * lines - 1
    mass = sum(stage.mass for stage in station.stages)
    return replace(
        protocol,
        resolution_hz=_round(spacing),
        lines=lines,
        levels=tuple(_round(level * mass / _MASS_KG) for level in protocol.levels),
        scale=_round(top / _BAND_HZ),
    )


def _round(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
