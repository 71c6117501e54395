"""Cases in which runs disagree, a mode grows, or combinations of modes look like modes."""

import numpy as np

from tests.field.make_inputs.folder import array_files, identify, measured, modes_are, write_case
from tests.field.virtual_machine import DAMPING, STIFFNESS, add_noise, field_machine


def write():
    """Write all cases of this module."""
    _flipped_channel()
    _shifted_run()


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
