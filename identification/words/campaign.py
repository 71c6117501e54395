"""Campaign: the tests of one machine, their conditions, and the tolerances of the drawings.

Large tests: a part of their lines or channels stands for all where a check needs no more.
"""

from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np

from identification.words._arrays import Mask, Real
from identification.words.frf import FrfEstimate
from identification.words.gains import UnknownGains
from identification.words.hits import HitEstimate
from identification.words.layout import Layout
from identification.words.names import shorten_names
from identification.words.ports import FLOOR, Dof, Input, Output, Signal, distinct_dofs

# Standard deviations within which every tolerance is kept in a fit; what lies beyond is an effect
# that the model lacks, or a fault of a sensor.
TOLERANCE_BOUND_SIGMA = 2.5
State = Literal["before", "after"]  # of the machine in a test, about a change
TOLERANCE_FACTORS = ("stiffness", "damping")  # factors of a log-normal distribution, from 1 on
DEFAULT_HAMMER = "default"  # name of the hammer of all tests that do not name theirs


@dataclass(frozen=True)
class Condition:
    """Conditions under which one test was made.

    Args:
        test: name of the file, as campaign.toml gives it.
        reference: degree of freedom at which the hammer hit, or motor that drove the machine.
        level_n: peak force [N], or peak of a signal in its unit; None if it was not recorded.
        spindle_speed: spindle speed [rad/s].
        setup: name of the roving set-up, or None.
        hammer: name of the hammer or drive that gave the force, or None if no name was stated.
        variant: name of the machine's variant, such as one with a known mass; empty for the
            machine of the campaign.
        drive_unit: unit of what drives the machine, and of the level: N, N m, or that of a signal.
        state: whether the test was made before or after a change of the machine; None if the
            campaign states no change.

    Raises:
        ValueError: the level is not positive, or a value is not finite.
    """

    test: str
    reference: Input
    level_n: float | None = None
    spindle_speed: float = 0.0
    setup: str | None = None
    hammer: str | None = None
    variant: str = ""
    drive_unit: str = "N"
    state: State | None = None

    def __post_init__(self) -> None:
        """Check the reference, the level and the spindle speed."""
        if not isinstance(self.reference, Dof | Signal):
            raise ValueError(f"reference is {self.reference!r}, expected a Dof or a Signal")
        if self.level_n is not None and not (np.isfinite(self.level_n) and self.level_n > 0):
            raise ValueError(f"level is {self.level_n} {self.drive_unit}, expected more than 0")
        if not np.isfinite(self.spindle_speed):
            raise ValueError(f"spindle speed is {self.spindle_speed} rad/s, expected a number")

    @property
    def level_text(self) -> str:
        """Level with its unit, such as ``200 N`` or ``0.1 V``; empty if it is unknown."""
        return "" if self.level_n is None else f"{self.level_n:g} {self.drive_unit}".rstrip()

    @property
    def instrument(self) -> str:
        """Name of the hammer or drive whose force channel this test shares with others.

        Tests share one hammer unless they name theirs. Each motor is an instrument of its own, and
        so is the accelerometer on the floor.
        """
        if self.hammer is not None:
            return self.hammer
        has_own = isinstance(self.reference, Signal) or self.reference.point == FLOOR
        return self.reference.point if has_own else DEFAULT_HAMMER


@dataclass(frozen=True, eq=False)
class Test:
    """Test: the FRFs of one file with the hammer at one reference (point and direction).

    Args:
        condition: conditions of the test.
        estimate: FRFs with one input, which is the reference of the condition.
        hits: hits from which the FRFs were estimated, on all lines; None for a file of FRFs.

    Raises:
        ValueError: the input of the FRFs is not the reference.
    """

    __test__ = False  # tells pytest that this is a hammer test, not a test case

    condition: Condition
    estimate: FrfEstimate
    hits: HitEstimate | None = None

    def __repr__(self) -> str:
        """Return file, reference and estimate in a few lines."""
        return f"test {self.condition.test} at {self.condition.reference}: {self.estimate!r}"

    def __post_init__(self) -> None:
        """Check that the input is the reference."""
        if self.estimate.frf.inputs != (self.condition.reference,):
            raise ValueError(
                f"inputs {self.estimate.frf.inputs} are not the reference "
                f"{self.condition.reference}"
            )


@dataclass(frozen=True)
class Tolerance:
    """Standard deviations of the real machine about its drawings.

    Args:
        mass, inertia, sensor_gain, hammer_gain: relative standard deviations.
        com, joint_position, sensor_position, hammer_position: standard deviations [m].
        sensor_angle, hammer_angle: standard deviations about each axis [rad].
        sensor_delay, hammer_delay: standard deviations of each channel's delay and of the force
            channel's [s].
        sensor_cross: standard deviation of the symmetric part of the transverse sensitivity; the
            antisymmetric part is a rotation, which ``sensor_angle`` holds.
        stiffness, damping: factors, one standard deviation of a log-normal distribution.

    Raises:
        ValueError: a value is negative or not finite.
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
    sensor_delay: float = 2e-5
    sensor_cross: float = 0.014
    hammer_gain: float = 0.02
    hammer_delay: float = 2e-5
    stiffness: float = 3.0
    damping: float = 4.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"tolerance {name} is {value}, expected 0 or more")
        for name in TOLERANCE_FACTORS:
            if getattr(self, name) < 1:
                raise ValueError(f"tolerance {name} is a factor of {getattr(self, name)}, below 1")


@dataclass(frozen=True, eq=False)
class Campaign:
    """Tests of one machine on one frequency axis.

    Args:
        name: name for messages and titles.
        tests: at least one test, all with the same frequencies and quantity.
        tolerance: tolerances of the drawings.
        remarks: sentences that a reader of any result must know.
        unknown_gains: channels and drives whose gains are unknown.
        has_two_machines: whether the states before and after are two machines of one drawing.

    Raises:
        ValueError: there is no test, or frequencies or quantities differ between tests.
    """

    name: str
    layout: Layout
    tests: tuple[Test, ...]
    tolerance: Tolerance = Tolerance()
    remarks: tuple[str, ...] = ()
    unknown_gains: UnknownGains = field(default_factory=UnknownGains)
    has_two_machines: bool = False

    def __post_init__(self) -> None:
        """Check that the tests share their frequencies and their quantity."""
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

    def __repr__(self) -> str:
        """Return tests, channels, lines and quantity in a few lines."""
        freq = self.freq_hz
        return (
            f"campaign {self.name}: {len(self.tests)} tests, {len(self.outputs)} channels, "
            f"{len(freq)} lines {freq[0]:g}..{freq[-1]:g} Hz, "
            f"{self.tests[0].estimate.frf.quantity}\n  hit at {shorten_names(self.inputs)}"
        )

    @property
    def freq_hz(self) -> Real:
        """Frequencies that all tests share [Hz]; (n_freq,)."""
        return self.tests[0].estimate.frf.freq_hz

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Channels of all tests, each once, with positive sign."""
        return distinct_dofs(dof for test in self.tests for dof in test.estimate.frf.outputs)

    @property
    def inputs(self) -> tuple[Input, ...]:
        """References of all tests, each once, with positive sign."""
        return distinct_dofs(test.condition.reference for test in self.tests)

    @property
    def variants(self) -> tuple[str, ...]:
        """Variants of the machine in which tests were made, each once, in their order."""
        return tuple(dict.fromkeys(test.condition.variant for test in self.tests))

    def select_variant(self, name: str) -> Self:
        """Return the campaign with the tests of one variant of the machine alone.

        Args:
            name: of the variant; empty for the machine of the campaign.

        Raises:
            ValueError: no test was made in it.
        """
        tests = tuple(test for test in self.tests if test.condition.variant == name)
        if not tests:
            raise ValueError(f"no test was made in {name or 'the machine of the campaign'}")
        return replace(self, tests=tests)

    @property
    def has_states(self) -> bool:
        """Whether tests were made before and after a change of the machine."""
        return any(test.condition.state is not None for test in self.tests)

    def select_state(self, state: State) -> Self:
        """Return the campaign with the tests of one state alone; itself if no test states one."""
        if not self.has_states:
            return self
        return replace(self, tests=tuple(t for t in self.tests if t.condition.state == state))

    def leave_out_after(self) -> Self:
        """Return the campaign without the tests after a change, and with a remark on it."""
        if not self.has_states:
            return self
        remark = "tests after the change are left out here: mbw diagnose compares them with these"
        return replace(self.select_state("before"), remarks=(*self.remarks, remark))

    def select_lines(self, chosen: Mask | slice) -> Self:
        """Return the campaign on these frequency lines alone.

        Args:
            chosen: mask (n_freq,) or slice of the lines.
        """
        tests = tuple(replace(t, estimate=t.estimate.select_lines(chosen)) for t in self.tests)
        return replace(self, tests=tests)

    def thin_lines(self) -> Self:
        """Return every n-th line of a large campaign, enough for a check; else all of it."""
        step = thinning_step(sum(test.estimate.frf.values.size for test in self.tests))
        return self if step == 1 else self.select_lines(slice(None, None, step))


# Values of FRFs that a check takes: three times the usual 69 x 3 x 801, some seconds and 200 MB.
MAX_CHECKED_VALUES = 500_000
# Values whose curves a page and files hold: a page of 60 MB, which browsers still open.
MAX_SHOWN_VALUES = 2_000_000


def thinning_step(n_values: int, limit: int = MAX_CHECKED_VALUES) -> int:
    """Return n such that every n-th of these values is few enough; 1 for all of them.

    Args:
        n_values: number of values of all FRFs: lines times channels times references.
        limit: number of values that is few enough.
    """
    return max(1, -(-n_values // limit))
