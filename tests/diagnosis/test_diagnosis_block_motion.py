"""Motion of a linear machine in blocks of steps, against one step after the other."""

import numpy as np

from diagnosis.levels.block_motion import MachineInBlocks
from diagnosis.levels.hammer_pulse import compute_pulse_force
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.settings import LEVEL_SETTINGS

RATE_HZ = 2000.0


def test_blocks_of_steps_are_one_step_after_the_other():
    random = np.random.default_rng(4)
    poles = 2 * np.pi * np.array([-1 + 20j, -2 + 55j, -9 + 130j])
    readout, joint = (random.standard_normal(3) + 1j * random.standard_normal(3) for _ in range(2))
    entry = random.standard_normal((3, 2)) + 1j * random.standard_normal((3, 2))
    machine = JointTransient(poles, readout, joint, entry, RATE_HZ, 1.0)
    hits = (
        SimulatedHits(np.array([0, 1]), np.array([3.0, 5.0]), 0.004),
        SimulatedHits(np.array([1]), np.array([2.0]), 0.0431),
    )
    count = 5 * LEVEL_SETTINGS.block_steps // 2
    times = np.arange(count + 1) / RATE_HZ
    forces = random.standard_normal((count + 1, 3))
    forces[0] = 0.0

    moving = MachineInBlocks.at_rest(machine, hits, np.arange(3), times)
    in_blocks = []
    for first in range(0, count, LEVEL_SETTINGS.block_steps):
        steps = min(LEVEL_SETTINGS.block_steps, count - first)
        free = moving.look_ahead(first)
        for k in range(1, steps + 1):
            past = sum(moving.kernel[k - 1 - m] * forces[first + m] for m in range(k))
            in_blocks.append(free[k - 1] - past - moving.compliance * forces[first + k])
        moving.advance(forces[first : first + steps])

    decay = np.exp(poles / RATE_HZ)[:, None]
    before, after = (weights[:, None] for weights in machine.hold_weights)
    durations = np.array([0.004, 0.004, 0.0431])
    driven = compute_pulse_force(times[:, None], durations) * np.array([3.0, 5.0, 2.0])
    state, stretch = np.zeros((3, 3), complex), []
    for n in range(1, count + 1):
        inward = [entry[:, [0, 1, 1]] * driven[k] - np.outer(joint, forces[k]) for k in (n - 1, n)]
        state = decay * state + before * inward[0] + after * inward[1]
        stretch.append((readout @ state).real)
    np.testing.assert_allclose(in_blocks, stretch, atol=1e-12 * np.abs(stretch).max())
