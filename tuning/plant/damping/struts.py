"""Struts of a machine: tendons or joints with a spring, along which an actuator pushes."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from identification.words import Real, UsageError, shorten_names
from mbmodel import Model, SpringPart


@dataclass(frozen=True, eq=False)
class Struts:
    """Struts in parallel with their actuators, each in series with a force sensor.

    Args:
        names: of the tendons or joints; n_strut.
        elongation: G, each strut's elongation per joint coordinate; (nv, n_strut).
        stiffness: k of each [N/m]; (n_strut,).
        damping: c of each [N s/m]; (n_strut,).
    """

    names: tuple[str, ...]
    elongation: Real
    stiffness: Real
    damping: Real

    def select(self, chosen: Sequence[int]) -> "Struts":
        """Return some of the struts.

        Args:
            chosen: their numbers.
        """
        numbers = list(chosen)
        return Struts(
            tuple(self.names[k] for k in numbers),
            self.elongation[:, numbers],
            self.stiffness[numbers],
            self.damping[numbers],
        )


def find_struts(model: Model, theta: Real, patterns: Sequence[str]) -> Struts:
    """Return the struts whose names match, in the order of the model.

    Args:
        theta: parameters in SI; (n_parameter,).
        patterns: names of tendons or joints; ``*`` stands for any text.

    Raises:
        UsageError: a pattern without a spring of stiffness.
    """
    jacobian = model.assemble(theta).jacobian
    rows = [
        row
        for part, values in zip(model.parts, model.split_parameters(theta), strict=True)
        if isinstance(part, SpringPart)
        for row in part.rows(values, jacobian)
        if row[2] > 0
    ]
    for pattern in patterns:
        if not any(fnmatchcase(spring.name, pattern) for spring, *_ in rows):
            known = shorten_names([spring.name for spring, *_ in rows])
            raise UsageError(
                f"no tendon or joint with stiffness is named {pattern!r}: choose of {known}"
            )
    chosen = [row for row in rows if any(fnmatchcase(row[0].name, pattern) for pattern in patterns)]
    return Struts(
        tuple(spring.name for spring, *_ in chosen),
        np.array([direction for _, direction, *_ in chosen]).T,
        np.array([stiffness for *_, stiffness, _ in chosen]),
        np.array([damping for *_, damping in chosen]),
    )
