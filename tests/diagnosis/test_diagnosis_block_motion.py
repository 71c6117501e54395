"""Motion of a linear machine in blocks of steps, against one step after the other."""

import numpy as np

from diagnosis.levels.block_motion import MachinesInBlocks
from diagnosis.levels.hammer_pulse import compute_pulse_force
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.settings import LEVEL_SETTINGS

RATE_HZ = 2000.0


def test_blocks_of_steps_are_one_step_after_the_other():
    random = np.random.default_rng(4)

    def draw(*shape):
        return random.standard_normal(shape) + 1j * random.standard_normal(shape)

    poles = 2 * np.pi * np.array([-1 + 20j, -2 + 55j, -9 + 130j])
    machines = [
        JointTransient(factor * poles, draw(3), draw(3), draw(3, 2), RATE_HZ, 1.0)
        for factor in (1.0, 1.3)
    ]
    columns, peaks = np.array([[0, 1], [1, 1]]), np.array([[3.0, 5.0], [2.0, 1.0]])
    durations = np.array([0.004, 0.0431])
    hits = [SimulatedHits(*case) for case in zip(columns, peaks, durations, strict=True)]
    count = 5 * LEVEL_SETTINGS.block_steps // 2
    times = np.arange(count + 1) / RATE_HZ
    forces = random.standard_normal((count + 1, 2, 2))
    forces[0] = 0.0

    moving = MachinesInBlocks.at_rest(list(zip(machines, hits, strict=True)), times)
    in_blocks = []
    for first in range(0, count, LEVEL_SETTINGS.block_steps):
        steps = min(LEVEL_SETTINGS.block_steps, count - first)
        free = moving.look_ahead(first)
        for k in range(1, steps + 1):
            past = sum(moving.kernel[k - 1 - m][:, None] * forces[first + m] for m in range(k))
            at_once = moving.compliance[:, None] * forces[first + k]
            in_blocks.append(free[k - 1] - past - at_once)
        moving.advance(forces[first : first + steps])

    for case, machine in enumerate(machines):
        decay = np.exp(machine.poles / RATE_HZ)[:, None]
        before, after = (weights[:, None] for weights in machine.hold_weights)
        driven = compute_pulse_force(times, durations[case])[:, None] * peaks[case]
        entry, joint = machine.input_entry[:, columns[case]], machine.joint_entry
        state, stretch = np.zeros((3, 2), complex), []
        for n in range(1, count + 1):
            inward = [entry * driven[k] - np.outer(joint, forces[k, case]) for k in (n - 1, n)]
            state = decay * state + before * inward[0] + after * inward[1]
            stretch.append((machine.readout @ state).real)
        by_blocks = np.array(in_blocks)[:, case]
        np.testing.assert_allclose(by_blocks, stretch, atol=1e-12 * np.abs(stretch).max())
