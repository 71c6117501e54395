"""A damper between spring and dashpot: its force follows a fractional derivative of the motion.

Along one direction of a joint the dynamic stiffness gains c s^alpha, 0 < alpha < 1: one Part with
one parameter, whose slope is the same at any c. The order alpha is scanned.
"""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from diagnosis import Effect, Hypothesis, Scene
from mbmodel import AddedPart, Change, Parameter

_ORDERS = 0.3, 0.4, 0.5, 0.6, 0.7  # of the scan: neighbours differ by 9 degrees in phase
_UNIT = 0.1  # of the stiffness of the joint: what a step of the fit is about


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each direction with a spring, and each order."""
    machine = scene.model.machine
    omega = 2 * np.pi * float(scene.session.campaign.freq_hz[-1])
    stiffness = {spring.name: spring.stiffness for spring in machine.springs}
    for axle in machine.axles:
        if not stiffness.get(axle.joint):
            continue
        for order in _ORDERS:
            name = f"{axle.joint}.fractional{order:g}"
            unit = _UNIT * stiffness[axle.joint]  # at the highest line
            frame = axle.motion(len(machine.coordinates))[:, None]
            core = np.zeros((1, 3, 1, 1))
            core[0, 0] = unit  # times the shape
            part = AddedPart.linear(
                f"joint:{axle.stage}",
                (Parameter(name, 0.0, f"{unit:g} N/m or N m/rad", positive=False),),
                (Change("joint", frame, frame, core, shape=partial(power, order, omega)),),
            )

            def state(
                found: Mapping[str, float],
                own: str = name,
                unit: float = unit / omega**order,
                order: float = order,
            ) -> dict[str, float]:
                return {"coefficient": unit * found[own], "order": order}

            yield Hypothesis(
                "fractional_damper",
                f"joint:{axle.stage}",
                axle.dof,
                parts=(part,),
                signed=True,
                otherwise=({name: 1 / _UNIT},),
                state=state,
            )


def power(order: float, omega: float, laplace: np.ndarray) -> np.ndarray:
    """(s / omega)^order: 1 in size at omega [rad/s]."""
    return np.asarray((laplace / omega) ** order, complex)


EFFECT = Effect(
    propose,
    noun="a fractional damper",
    means="a damper whose loss grows with a broken power of frequency, as a polymer's",
    confirm="take the damper of {place} {direction} off and repeat",
)
