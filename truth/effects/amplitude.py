"""How far a joint moves under a hit, before anything nonlinear is in it."""

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import StageDirection
from truth.machine.rig import Prepared, build, receptance
from truth.machine.station import Hammer

_SPACING_HZ, _HIGHEST_HZ = 1.0, 400.0
_PULSE_SECONDS = 5.7e-3  # of a usual hit


def peak_stretch(scene: Scene, direction: StageDirection) -> float:
    """Return the largest stretch that a hit of the middle level makes in a joint [m or rad].

    A half sine of peak A and duration T has the momentum 2 A T / pi; the linear machine's answer
    is the inverse transform of its receptance times the spectrum of such a hit.
    """
    levels = sorted(occasion.level for occasion in scene.occasions)
    level = levels[len(levels) // 2]
    nodes = sorted({occasion.node for occasion in scene.occasions if occasion.node >= 0})
    aims = [(node, *scene.station.aim(node)) for node in nodes]
    hammers = tuple(
        Hammer(node, stage, point, axis)
        for node, stage, point in aims
        for axis in scene.station.aim_axes(node)
    )
    tested = Prepared(scene.station, hammers)
    rig = build(tested)
    spacing, pulse = _SPACING_HZ * scene.pace, _PULSE_SECONDS / scene.pace
    lines = scene.pace * np.arange(_SPACING_HZ, _HIGHEST_HZ, _SPACING_HZ)
    cycles = lines * pulse
    force = level * pulse / 2 * (np.sinc(cycles - 0.5) + np.sinc(cycles + 0.5))
    force = force * np.exp(-1j * np.pi * cycles)
    motion = direction.stretch(rig, tested) @ receptance(rig, lines, rig.drive)
    spectrum = np.vstack([np.zeros((1, motion.shape[1])), motion * force[:, None]])
    samples = np.fft.irfft(spectrum, axis=0) * 2 * (len(lines)) * spacing
    return float(np.abs(samples).max())
