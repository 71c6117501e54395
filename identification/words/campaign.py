"""A campaign: the tests of one machine, what differed between them, and how exact drawings are."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.words._arrays import Mask, Real
from identification.words.dof import Dof, distinct
from identification.words.frf import FrfEstimate
from identification.words.hits import HitEstimate
from identification.words.layout import Layout


@dataclass(frozen=True)
class Condition:
    """What differed between tests of one machine.

    Args:
        test: the file, as campaign.toml names it.
        reference: where and along what the hammer hit.
        level_n: peak force [N], or None if it was not recorded.
        spindle_speed: [rad/s].
        setup: which roving set-up, or None.
    """

    test: str
    reference: Dof
    level_n: float | None = None
    spindle_speed: float = 0.0
    setup: str | None = None

    def __post_init__(self) -> None:
        """Check the level."""
        if self.level_n is not None and not (np.isfinite(self.level_n) and self.level_n > 0):
            raise ValueError(f"level is {self.level_n} N, expected more than 0")
        if not np.isfinite(self.spindle_speed):
            raise ValueError(f"spindle speed is {self.spindle_speed} rad/s, expected a number")


@dataclass(frozen=True, eq=False)
class Test:
    """One reference (point and direction) of one file: the hammer did not move within it.

    Args:
        condition: what was special about it.
        estimate: FRFs with one input, the condition's reference.
        hits: how they were made, if from time records; on all lines, whatever the estimate keeps.
    """

    __test__ = False  # the field's word, not a case for pytest

    condition: Condition
    estimate: FrfEstimate
    hits: HitEstimate | None = None

    def __post_init__(self) -> None:
        """Check that the input is the reference."""
        if self.estimate.frf.inputs != (self.condition.reference,):
            raise ValueError(
                f"inputs {self.estimate.frf.inputs} are not the reference "
                f"{self.condition.reference}"
            )


@dataclass(frozen=True)
class Tolerance:
    """One standard deviation of what the drawings say.

    Args:
        mass, inertia, sensor_gain: relative.
        com, joint_position, sensor_position, hammer_position: [m].
        sensor_angle, hammer_angle: [rad], about each axis.
    """

    mass: float = 0.02
    inertia: float = 0.05
    com: float = 0.003
    joint_position: float = 0.003
    sensor_gain: float = 0.01
    sensor_angle: float = 0.01745
    sensor_position: float = 0.0015
    hammer_angle: float = 0.01745
    hammer_position: float = 0.003

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"tolerance {name} is {value}, expected 0 or more")


@dataclass(frozen=True, eq=False)
class Campaign:
    """The tests of one machine on one frequency axis.

    Args:
        name: for messages and titles.
        layout: bodies and points.
        tests: at least one, all with the same frequencies and quantity.
        tolerance: of the drawings.
        remarks: sentences that a reader of any result must know.

    Raises:
        ValueError: no test, or tests that cannot stand beside one another.
    """

    name: str
    layout: Layout
    tests: tuple[Test, ...]
    tolerance: Tolerance = Tolerance()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that the tests share their axis."""
        if not self.tests:
            raise ValueError("a campaign needs at least one test")
        object.__setattr__(self, "tests", tuple(self.tests))
        first = self.tests[0].estimate.frf
        for test in self.tests[1:]:
            frf = test.estimate.frf
            if not np.array_equal(frf.freq_hz, first.freq_hz):
                raise ValueError(f"{test.condition.test} has another frequency axis")
            if frf.quantity != first.quantity:
                raise ValueError(
                    f"{test.condition.test} holds {frf.quantity}, not {first.quantity}"
                )

    @property
    def freq_hz(self) -> Real:
        """Frequencies of every test [Hz]; (n_freq,)."""
        return self.tests[0].estimate.frf.freq_hz

    @property
    def outputs(self) -> tuple[Dof, ...]:
        """Channels of all tests, along positive axes."""
        return distinct(dof for test in self.tests for dof in test.estimate.frf.outputs)

    @property
    def inputs(self) -> tuple[Dof, ...]:
        """Points that were hit in any test, along positive axes."""
        return distinct(test.condition.reference for test in self.tests)

    def lines(self, chosen: Mask | slice) -> Self:
        """Keep these frequency lines of every test."""
        tests = tuple(replace(t, estimate=t.estimate.lines(chosen)) for t in self.tests)
        return replace(self, tests=tests)
