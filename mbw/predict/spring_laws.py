"""Texts of ``--loss-factor``, ``--delay`` and ``--maxwell``: laws of springs beyond MJCF."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from identification.readers.campaign_toml import (
    MAX_BRANCH_RATIO,
    MAX_LAW_TIME_S,
    MAX_LOSS_FACTOR,
)
from identification.words import InputError, UsageError, read_number, shorten_names
from mbmodel import (
    ConstantLoss,
    LateForce,
    Machine,
    Model,
    Part,
    Relaxation,
    Spring,
    spring_law_part,
    spring_parts,
)

_PARAMETER_NAMES = {"loss-factor": "loss_factor", "delay": "delay", "maxwell": "maxwell"}


@dataclass(frozen=True)
class SpringLaw:
    """A law of the springs of one joint, tendon or stage.

    Args:
        option: name of the option without dashes, such as ``loss-factor``.
        name: of the joint, tendon or stage.
        size: loss factor, 1 for a delay, or ratio of the branch to the static stiffness.
        shape: law, which holds the time of a delay or branch.
    """

    option: str
    name: str
    size: float
    shape: ConstantLoss | LateForce | Relaxation

    def springs_of(self, machine: Machine) -> list[Spring]:
        """Return the springs with stiffness that the name means."""
        springs = [spring for spring in machine.springs if spring.stiffness]
        named = [spring for spring in springs if spring.name == self.name]
        return named or [spring for spring in springs if spring.location == f"joint:{self.name}"]


def parse_laws(
    loss_factors: Sequence[str], delays: Sequence[str], branches: Sequence[str]
) -> tuple[SpringLaw, ...]:
    """Return the laws that the options name.

    Args:
        loss_factors: texts ``JOINT=ETA``.
        delays: texts ``JOINT=SECONDS``.
        branches: texts ``JOINT=RATIO@SECONDS``.

    Raises:
        UsageError: a text that is written otherwise.
        InputError: a number without sense.
    """
    laws = []
    for text in loss_factors:
        name, (size,) = _numbers_of("loss-factor", text, "ETA", 1)
        _refuse_outside("loss-factor", text, size, MAX_LOSS_FACTOR, "a loss factor")
        laws.append(SpringLaw("loss-factor", name, size, ConstantLoss()))
    for text in delays:
        name, (time,) = _numbers_of("delay", text, "SECONDS", 1)
        _refuse_outside("delay", text, time, MAX_LAW_TIME_S, "a delay in s")
        laws.append(SpringLaw("delay", name, 1.0, LateForce(time)))
    for text in branches:
        name, (size, time) = _numbers_of("maxwell", text, "RATIO@SECONDS", 2)
        _refuse_outside("maxwell", text, size, MAX_BRANCH_RATIO, "a ratio")
        _refuse_outside("maxwell", text, time, MAX_LAW_TIME_S, "a time in s")
        laws.append(SpringLaw("maxwell", name, size, Relaxation(time)))
    return tuple(laws)


def _numbers_of(option: str, text: str, form: str, count: int) -> tuple[str, list[float]]:
    """Return name and numbers of a text ``NAME=number@number``."""
    name, _, numbers = text.rpartition("=")
    values = [read_number(word) for word in numbers.split("@")]
    if not name or len(values) != count or not all(map(math.isfinite, values)):
        raise UsageError(f"--{option} {text!r}: write JOINT={form} with a joint, tendon or stage")
    return name, values


def _refuse_outside(option: str, text: str, value: float, largest: float, what: str) -> None:
    if not 0 < value <= largest:
        raise InputError(f"--{option} {text}: give {what} above 0 and up to {largest:g}")


def model_with_laws(machine: Machine, laws: Sequence[SpringLaw], *, is_partial: bool) -> Model:
    """Return the nominal model with laws of its springs.

    Args:
        machine: with the springs.
        laws: of its joints, tendons and stages.
        is_partial: whether laws of springs that the machine lacks are left out.

    Raises:
        InputError: a law of no spring, or two laws of one kind for one spring.
    """
    parts: list[Part] = list(spring_parts(machine))
    names: set[tuple[str, str]] = set()
    for law in laws:
        springs = law.springs_of(machine)
        if not springs and not is_partial:
            known = dict.fromkeys(spring.name for spring in machine.springs if spring.stiffness)
            raise InputError(
                f"--{law.option}: {machine.source} has no spring with stiffness at {law.name!r}: "
                f"name a stage or one of {shorten_names(list(known))}"
            )
        for spring in springs:
            if (spring.name, law.option) in names:
                raise InputError(f"--{law.option} names {spring.name!r} twice: give it one law")
            names.add((spring.name, law.option))
            name = _PARAMETER_NAMES[law.option]
            parts.append(spring_law_part(spring, name, law.size, law.shape))
    return Model(machine, tuple(parts))
