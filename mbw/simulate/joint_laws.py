"""Texts ``JOINT:EFFECT:NAME=VALUE,...`` of nonlinear joints, and the machine that has them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from identification.words import UsageError, WorkbenchError, read_number, shorten_names
from identification.words.file_access import temporary_folder
from mbmodel import (
    DryFriction,
    GapSpring,
    JenkinsElement,
    Machine,
    NonlinearJoint,
    PolynomialSpring,
    load_machine,
    write_nonlinear_joints,
)

_EXAMPLE = "ty_ty:friction:k=2e7,limit=50"
# Parameters of each effect: those that must be given, then those that may.
_PARAMETERS = {
    "friction": (("limit",), ("k",)),
    "backlash": (("gap",), ("preload",)),
    "hardening": (("k3",), ("k2",)),
}


@dataclass(frozen=True, eq=False)
class SimulatedMachine:
    """A machine as it is simulated, and the file that the user has named.

    Args:
        machine: as simulated.
        source: MJCF that the user has named.
        laws: effect and law of each joint that was made nonlinear.
    """

    machine: Machine
    source: Path
    laws: tuple[tuple[str, NonlinearJoint], ...] = ()


@contextmanager
def open_machine(
    source: Path, texts: Sequence[str], rates: Mapping[str, float], key: str | None
) -> Iterator[SimulatedMachine]:
    """Yield the machine of a file, with further nonlinear joints; its MJCF exists meanwhile.

    Args:
        texts: laws of joints.
        rates: of spinning hinges [rad/s].
        key: keyframe that gives pose and controls; None for ``home`` if there is one.

    Raises:
        UsageError: a text is no law, or the machine has no such joint.
        InputError: the file cannot be read or written anew.
    """
    drawing = load_machine(source, rates, key, without_friction=True)
    if not texts:
        yield SimulatedMachine(drawing, source)
        return
    laws = tuple(parse_law(drawing, text) for text in texts)
    with temporary_folder() as folder:
        target = folder / "simulated.xml"
        try:
            write_nonlinear_joints(source, target, [law for _, law in laws])
            machine = load_machine(target, rates, key, without_friction=True)
            yield SimulatedMachine(machine, source, laws)
        except WorkbenchError as error:
            # The written file exists for this run alone: name what the user has given.
            named = " ".join([str(source), *(f"--law {text}" for text in texts)])
            raise type(error)(str(error).replace(str(target), named)) from error


def parse_law(machine: Machine, text: str) -> tuple[str, NonlinearJoint]:
    """Return the effect and the law that a text names.

    Backlash and hardening take the joint's own stiffness. Friction without ``k`` is dry friction.

    Args:
        machine: as drawn, with the joints' stiffness.
        text: such as ``ty_ty:friction:k=2e7,limit=50``.

    Raises:
        UsageError: the text is none, or the machine has no such joint.
    """
    joint, _, rest = text.partition(":")
    effect, _, list_of_numbers = rest.partition(":")
    if effect not in _PARAMETERS:
        raise UsageError(
            f"--law {text!r}: write JOINT:EFFECT:NAME=VALUE,..., with one of "
            f"{', '.join(_PARAMETERS)}, such as {_EXAMPLE}"
        )
    joints = [axle.joint for axle in machine.axles]
    if joint not in joints:
        raise UsageError(
            f"--law {text!r}: {machine.source} has no slide or hinge {joint!r}: choose one of "
            f"{shorten_names(joints)}"
        )
    numbers = _parse_numbers(text, effect, list_of_numbers)
    stiffness = next(spring.stiffness for spring in machine.springs if spring.name == joint)
    if effect == "hardening":
        return effect, PolynomialSpring(joint, stiffness, numbers.get("k2", 0.0), numbers["k3"])
    if effect == "backlash":
        return effect, GapSpring(joint, stiffness, numbers["gap"], numbers.get("preload", 0.0))
    if "k" in numbers:
        return effect, JenkinsElement(joint, numbers["k"], numbers["limit"])
    return effect, DryFriction(joint, numbers["limit"])


def _parse_numbers(text: str, effect: str, list_of_numbers: str) -> dict[str, float]:
    """Return the parameters ``NAME=VALUE`` of an effect."""
    needed, optional = _PARAMETERS[effect]
    numbers: dict[str, float] = {}
    for part in filter(None, list_of_numbers.split(",")):
        name, _, value = part.partition("=")
        numbers[name.strip()] = number = read_number(value)
        if math.isnan(number):
            raise UsageError(f"--law {text!r}: {part!r} is no NAME=VALUE: write a number")
    unknown = [name for name in numbers if name not in needed + optional]
    missing = [name for name in needed if name not in numbers]
    if unknown or missing:
        raise UsageError(
            f"--law {text!r}: {effect} has {', '.join(needed)}, and if you like "
            f"{', '.join(optional)}: state these"
        )
    return numbers
