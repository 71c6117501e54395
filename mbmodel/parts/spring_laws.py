"""Springs that follow another law than k: losses, delays and relaxation, as factors of s.

    loss factor   k (1 + i eta sign(w))                 ConstantLoss, eta times it
    delay         k exp(-s tau)                         LateForce, the change from k
    relaxation    k (1 + r s tau / (1 + s tau))         Relaxation, r times it (a Maxwell branch)

Conventions: exp(+i w t), a loss factor dissipates if it is positive (Ewins 2000, sec. 2.4).

Loss factors and Maxwell branches of the nominal model: ``[spring.NAME]`` and texts of an MJCF.

MuJoCo has no such laws. A written MJCF keeps them as texts, which MuJoCo ignores and this project
reads:

    <custom> <text name="spring:NAME" data="loss_factor=0.05 maxwell=0.7@0.045"/> </custom>
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from identification.words import Complex, InputError, Real, shorten_names
from mbmodel.linearisation.springs import DrawnLaw, Spring
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Element
from mbmodel.parts.added import AddedPart
from mbmodel.parts.part import Change, Parameter


@dataclass(frozen=True)
class ConstantLoss:
    """The law i sign(w) of a loss that does not grow with frequency."""

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        return np.asarray(1j * np.sign(laplace.imag), complex)


@dataclass(frozen=True)
class LateForce:
    """The law exp(-s tau) - 1 of a force that acts late.

    Args:
        delay_s: tau [s].
    """

    delay_s: float

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        return np.asarray(np.expm1(-laplace * self.delay_s), complex)


@dataclass(frozen=True)
class Relaxation:
    """The law s tau / (1 + s tau) of a spring in series with a damper.

    Args:
        time_s: tau [s].
    """

    time_s: float

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        return np.asarray(laplace * self.time_s / (1 + laplace * self.time_s), complex)


ShapeOfLaw = Callable[[Complex], Complex]


def spring_law_part(spring: Spring, name: str, size: float, shape: ShapeOfLaw) -> AddedPart:
    """Return a Part that adds size k f(s) to a spring, k its nominal stiffness.

    Args:
        spring: of the machine.
        name: of the law, such as ``loss_factor``; the parameter is ``<spring>.<name>``.
        size: nominal value of the parameter, such as the loss factor.
        shape: f(s).
    """
    parameter = Parameter(f"{spring.name}.{name}", size, "1", positive=False)
    finite = partial(_change_of_spring, spring, shape)

    def derivatives(theta: Real) -> tuple[Change, ...]:
        del theta
        (change,) = finite(np.ones(1))
        return (Change("joint", change.left, change.right, change.core[None], shape=shape),)

    return AddedPart(spring.location, (parameter,), finite, derivatives)


def _change_of_spring(spring: Spring, shape: ShapeOfLaw, theta: Real) -> tuple[Change, ...]:
    """Return the change size k f(s) along a spring."""
    core = np.zeros((3, 1, 1))
    core[0] = float(theta[0]) * spring.stiffness
    direction = spring.direction[:, None]
    return (Change("joint", direction, direction, core, shape=shape),)


_TEXT_PREFIX = "spring:"
_JOINT_PREFIX = "joint:"


@dataclass(frozen=True)
class StatedLaws:
    """Laws of springs as they are stated.

    Args:
        loss_factor: eta of k (1 + i eta sign(w)); 0 for none.
        maxwell: ratio to the static stiffness and time constant [s] of each branch.
    """

    loss_factor: float = 0.0
    maxwell: tuple[tuple[float, float], ...] = ()

    @property
    def laws(self) -> tuple[DrawnLaw, ...]:
        """Laws of a spring."""
        loss = (
            [DrawnLaw("loss_factor", self.loss_factor, ConstantLoss())] if self.loss_factor else []
        )
        return (
            *loss,
            *(DrawnLaw("maxwell", ratio, Relaxation(tau)) for ratio, tau in self.maxwell),
        )


def with_spring_laws(
    machine: Machine, stated: Mapping[str, StatedLaws], place: str, *, in_mjcf: bool = False
) -> Machine:
    """Return a machine whose springs have the stated laws; stated again alike, they stay.

    Args:
        machine: machine with the springs.
        stated: laws by the name of a joint (its child body), joint direction or tendon.
        place: file that states them, for messages.
        in_mjcf: whether texts of the MJCF state them.

    Raises:
        InputError: a name that no spring has, or a spring that has other laws already.
    """
    laws_of: dict[str, tuple[DrawnLaw, ...]] = {}
    origin: dict[str, str] = {}
    for name, laws in stated.items():
        for spring in _find_springs(machine, name, place):
            if spring.name in laws_of:
                raise InputError(
                    f"{place}: spring.{origin[spring.name]} and spring.{name} both state the laws "
                    f"of {spring.name}: state them once"
                )
            if spring.laws and set(spring.laws) != set(laws.laws):
                raise InputError(
                    f"{place}: spring.{name}: {machine.source.name} states other laws of "
                    f"{spring.name} in its text {_TEXT_PREFIX}{spring.name}: correct one of both"
                )
            laws_of[spring.name], origin[spring.name] = laws.laws, name
    springs = tuple(
        replace(spring, laws=laws_of[spring.name], has_law_text=in_mjcf or spring.has_law_text)
        if spring.name in laws_of
        else spring
        for spring in machine.springs
    )
    return replace(machine, springs=springs)


def _find_springs(machine: Machine, name: str, place: str) -> list[Spring]:
    """Return the springs with stiffness that a name means.

    Raises:
        InputError: there is none.
    """
    plain = name.removeprefix(_JOINT_PREFIX)
    named = [spring for spring in machine.springs if spring.name == plain] or [
        spring for spring in machine.springs if spring.location == f"{_JOINT_PREFIX}{plain}"
    ]
    if stiff := [spring for spring in named if spring.stiffness]:
        return stiff
    if named:
        raise InputError(
            f"{place}: spring.{name} has no stiffness in {machine.source.name}, so that its laws "
            "add nothing: give it one, or remove the table"
        )
    springs = [spring for spring in machine.springs if spring.stiffness]
    stages = dict.fromkeys(s.location.removeprefix(_JOINT_PREFIX) for s in springs)
    spring_names = list(dict.fromkeys([*stages, *(spring.name for spring in springs)]))
    near = get_close_matches(plain, spring_names, 1)
    hint = f"did you mean {near[0]}?" if near else f"name one of {shorten_names(spring_names)}"
    raise InputError(
        f"{place}: spring.{name}: {machine.source.name} has no joint, joint direction or tendon "
        f"of this name with a spring: {hint}"
    )


def read_law_texts(model: mujoco.MjModel, machine: Machine, path: Path) -> Machine:
    """Return a machine with the laws that texts of its MJCF state, and a remark on them.

    Args:
        machine: machine that was read from it.
        path: path of the MJCF, for messages.

    Raises:
        InputError: a text that states no laws, or a name that no spring has.
    """
    texts = {}
    for number in range(model.ntext):
        title = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, number) or ""
        if title.startswith(_TEXT_PREFIX):
            name, start = title.removeprefix(_TEXT_PREFIX), int(model.text_adr[number])
            content = model.text_data[start:].split(b"\0", 1)[0].decode()
            texts[name] = _parse_laws(content, name, path)
    if not texts:
        return machine
    remark = (
        "texts of the MJCF state loss factors or Maxwell branches of "
        f"{shorten_names(list(texts))}, which MuJoCo itself and simulations in time leave out"
    )
    machine = with_spring_laws(machine, texts, str(path), in_mjcf=True)
    return replace(machine, remarks=(*machine.remarks, remark))


def _parse_laws(text: str, name: str, path: Path) -> StatedLaws:
    """Return the laws of a text such as ``loss_factor=0.05 maxwell=0.7@0.045``.

    Raises:
        InputError: it is written otherwise, or a number is not above zero.
    """
    stated = StatedLaws()
    try:
        for word in text.split():
            kind, _, numbers = word.partition("=")
            values = [float(number) for number in numbers.split("@")]
            if not all(np.isfinite(values)) or min(values) <= 0:
                raise ValueError(word)
            if kind == "loss_factor":
                (loss,) = values
                stated = replace(stated, loss_factor=loss)
            elif kind == "maxwell":
                ratio, tau = values
                stated = replace(stated, maxwell=(*stated.maxwell, (ratio, tau)))
            else:
                raise ValueError(word)
    except ValueError as error:
        raise InputError(
            f"{path}: the text {_TEXT_PREFIX}{name} is {text!r}: write loss_factor=ETA and "
            "maxwell=RATIO@SECONDS, all above zero"
        ) from error
    return stated


def write_law_texts(springs: Sequence[Spring]) -> tuple[Addition, ...]:
    """Return the texts that state the laws of springs, where the source MJCF has none."""
    additions = []
    for spring in springs:
        words = [
            f"maxwell={law.size!r}@{law.shape.time_s!r}"
            if isinstance(law.shape, Relaxation)
            else f"loss_factor={law.size!r}"
            for law in spring.laws
        ]
        if words and not spring.has_law_text:
            name = f"{_TEXT_PREFIX}{spring.name}"
            text = Element("text", {"name": name, "data": " ".join(words)})
            additions.append(Addition(name, "custom", text))
    return tuple(additions)
