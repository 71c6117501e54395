"""The linear information of a test of a nominal machine, without errors and without effects."""

from dataclasses import dataclass, replace

import numpy as np

from truth.campaign.draw import NO_TOLERANCE, Tolerances
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.protocol import Protocol, occasions, takes
from truth.campaign.survival import SurvivalRefit, refit_of
from truth.campaign.virtual_test import hammers_of
from truth.effects import Scene
from truth.machine.station import Station

MAX_VALUES = 16_000  # complex values of the signatures: fits see about as many
_MIN_REFIT_LINES = 24


@dataclass(frozen=True, eq=False)
class LinearisedTest:
    """A test of a nominal machine, linearised.

    Args:
        refit: of the machine without effects.
        scene: the machine and its test.
        scale: lines that a fit sees over those of the refit.
        lines: frequency lines of the whole test.
        values: complex values of the whole test.
    """

    refit: SurvivalRefit
    scene: Scene
    scale: float
    lines: int
    values: int

    def thin(self, stride: int) -> "LinearisedTest":
        """Return the test as a fit of every so manyth line sees it."""
        return replace(self, scale=self.lines / stride / len(self.refit.known.freq_hz))


def linearise_test(
    station: Station, protocol: Protocol, tolerance: Tolerances, max_values: int = MAX_VALUES
) -> LinearisedTest:
    """Linearise a test about the nominal machine.

    Args:
        station: the nominal machine.
        protocol: how it is tested; the files of one level count.
        tolerance: standard deviations of the priors.
        max_values: complex values of the signatures, about.
    """
    files = takes(protocol, station, 0)
    level = sorted(protocol.levels)[len(protocol.levels) // 2]
    level_takes = tuple(take for take in files if take.test or take.level == level)
    machine = TrueMachine(station, hammers_of(station, protocol, NO_TOLERANCE, 0))
    cells = 3 * len(list(station.sensors())) * len(machine.hammers)
    count = max(_MIN_REFIT_LINES, max_values // cells)
    refit = refit_of(machine, protocol, level_takes, tolerance, count=count)
    measured = np.isfinite(refit.deviation).all(axis=0) & refit.used[:, None]
    lines = int((protocol.freq_hz >= refit.known.freq_hz[0]).sum())
    scene = Scene(station, occasions(protocol, files), protocol.pace)
    scale = lines / len(refit.known.freq_hz)
    return LinearisedTest(refit, scene, scale, lines, int(measured.sum()) * lines)
