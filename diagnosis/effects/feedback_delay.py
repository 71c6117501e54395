"""A spring that is a control loop with a delay: k exp(-s tau) instead of k.

The first power of tau is a damper, which is tuned anyway; what is left is taken with one delay
that turns the phase by half a radian at the highest line, whose size says how long the true one is.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from diagnosis.effects.points import along, jointed, springs_of
from diagnosis.hypothesis import Hypothesis, Scene, Value
from identification.words import Complex
from mbmodel import AddedPart, Parameter

_TURN = 0.5  # rad at the highest line


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each spring of each joint."""
    machine = scene.model.machine
    delay = _TURN / (2 * np.pi * float(scene.session.campaign.freq_hz[-1]))

    def late(laplace: Complex) -> Complex:
        return np.asarray(np.exp(-laplace * delay) - 1, complex)

    for stage in jointed(machine):
        for spring in springs_of(machine, stage):
            name = f"{spring}.delayed"
            slope = along(machine, (spring,), scene.stiffness((spring,)))
            part = AddedPart.linear(
                f"joint:{stage}",
                (Parameter(name, 0.0, "1", positive=False),),
                (replace(slope, shape=late),),
            )

            def state(found: Mapping[str, float], size: str = name) -> dict[str, Value]:
                # (s tau)^2 / 2 is what no damper is.
                return {"delay": delay * float(np.sqrt(max(found[size], 0.0)))}

            yield Hypothesis(
                "feedback_delay",
                f"joint:{stage}",
                spring.removeprefix(f"{stage}_"),
                parts=(part,),
                springs=(spring,),
                signed=True,
                state=state,
            )
