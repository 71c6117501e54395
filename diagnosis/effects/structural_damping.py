"""A joint whose loss does not grow with frequency: k (1 + i eta), K += i sign(w) eta k."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from diagnosis.effects.points import along, jointed, springs_of
from diagnosis.hypothesis import Hypothesis, Scene, Value
from identification.words import Complex
from mbmodel import AddedPart, Parameter


def lossy(laplace: Complex) -> Complex:
    """I sign(w); (n_freq,)."""
    return np.asarray(1j * np.sign(laplace.imag), complex)


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint."""
    machine = scene.model.machine
    for stage in jointed(machine):
        springs = springs_of(machine, stage)
        name = f"{stage}.loss_factor"
        slope = replace(along(machine, springs, scene.stiffness(springs)), shape=lossy)
        part = AddedPart.linear(
            f"joint:{stage}", (Parameter(name, 0.0, "1", positive=False),), (slope,)
        )

        def state(found: Mapping[str, float], loss: str = name) -> dict[str, Value]:
            return {"loss_factor": found[loss]}

        yield Hypothesis(
            "structural_damping",
            f"joint:{stage}",
            parts=(part,),
            springs=springs,
            signed=True,
            state=state,
        )
