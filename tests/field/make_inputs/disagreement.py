"""Cases in which runs disagree, a mode grows, or combinations of modes look like modes."""

import numpy as np

from tests.field.make_inputs.folder import array_files, identify, measured, modes_are, write_case
from tests.field.virtual_machine import DAMPING, STIFFNESS, add_noise, field_machine


def write():
    """Write all cases of this module."""
    _flipped_channel()
    _shifted_run()
    _growing_mode()


def _flipped_channel():
    values, coherence = measured()
    values[:, 1, 1] *= -1
    write_case(
        "disagreement/channel_reversed_in_one_run",
        "channel 2 is reversed in the second of two runs",
        "the four modes; the channel is named, and no drive point is blamed",
        [
            identify(
                "--json",
                "r.json",
                says=["acc2:+tz reads with the opposite sign in one of the runs"],
                never=["drive point"],
                value=modes_are(*field_machine().modes()),
            )
        ],
        array_files(values, coherence),
    )


def _shifted_run():
    machine, shifted = (
        field_machine(),
        field_machine(np.array(STIFFNESS) * 0.99**2, np.array(DAMPING) * 0.99),
    )
    values, coherence = add_noise(
        np.dstack([machine.accelerance()[:, :, :1], shifted.accelerance()[:, :, 1:]])
    )
    write_case(
        "disagreement/frequencies_lower_in_one_run",
        "all frequencies are 1 % lower in the second of two runs",
        "the modes of the first run; the shift is named",
        [
            identify(
                "--json",
                "r.json",
                says=["frequencies shift by -1"],
                never=["a mode may be missing"],
                value=modes_are(*machine.modes()),
            )
        ],
        array_files(values.astype(np.complex64), coherence.astype(np.float32)),
    )


def _growing_mode():
    machine = field_machine(damping=(*DAMPING[:2], -DAMPING[2], DAMPING[3]))
    freq_hz, damping = machine.modes()
    values, coherence = measured(machine)
    write_case(
        "disagreement/one_mode_grows",
        "a plant measured in its loop: one mode of four has negative damping",
        "the four modes, one with its negative damping; it can be forced too",
        [
            identify(
                "--json",
                "r.json",
                says=["Mode 2 at 41.09 Hz grows, with a damping ratio of -0.9"],
                never=["a mode may be missing"],
                value=modes_are(freq_hz, damping),
            ),
            identify("--overwrite", "--force", "41.09,-1", "--json", "r.json"),
        ],
        array_files(values, coherence),
    )
