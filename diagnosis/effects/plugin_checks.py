"""Checks of a hypothesis that a plug-in proposes: names, shapes, slopes and stated numbers.

A hypothesis must add a Part, release a tolerance or correct the measurement. Its parameters must
have one name each and be zero in the nominal model. Frames and cores of its Parts must fit the
machine. All numbers must be finite. Slopes must agree with central differences of the change, a
small step away from the start. ``state`` must return numbers at the start.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.settings import HALF_PRECISION
from diagnosis.stated_values import Value
from identification.words import Complex
from mbmodel import Change, Machine, Part, PartContext

_PLACE_KINDS = "joint", "body", "sensor", "hammer", "pair"


def find_fault(hypothesis: Hypothesis, scene: Scene, seen: dict[str, Part]) -> str | None:
    """Return what is wrong with a hypothesis; None if it can be fitted.

    Args:
        scene: scene for which it was proposed.
        seen: Parts of earlier hypotheses by the names of their parameters, which is extended.
    """
    if not (hypothesis.dof is None or isinstance(hypothesis.dof, str)):
        return f"its dof is {hypothesis.dof!r}: say a word, such as tx, or None"
    if hypothesis.location.partition(":")[0] not in _PLACE_KINDS:
        kinds = ", ".join(_PLACE_KINDS)
        return f"it is at {hypothesis.location!r}: begin with one of {kinds}, and a colon"
    if not (hypothesis.coordinates or hypothesis.correct):
        return "it frees nothing: give it parts, or tolerances to release"
    return _find_naming_fault(hypothesis, scene, seen) or _find_misfit(hypothesis, scene)


def _find_naming_fault(hypothesis: Hypothesis, scene: Scene, seen: dict[str, Part]) -> str | None:
    """Return what is wrong with the names of parameters; see ``find_fault``."""
    names = set()
    for part in hypothesis.parts:
        for parameter in part.parameters:
            name = parameter.name
            if name in names or seen.setdefault(name, part) is not part:
                return f"its parameter {name} is named twice: name each of every Part differently"
            names.add(name)
            if name not in hypothesis.follow and (parameter.drawn != 0 or parameter.positive):
                return (
                    f"its parameter {name} is drawn as {parameter.drawn:g}, as something on the "
                    "drawing: say drawn 0.0 and positive=False"
                )
    varies = set(scene.session.parametrisation.names)
    present = {parameter.name for parameter in scene.model.parameters}
    started = {name for values in (hypothesis.begin, *hypothesis.otherwise) for name in values}
    unknown = {*hypothesis.release, *hypothesis.scored} - names - varies
    unknown |= {*hypothesis.follow, *hypothesis.believed} - names
    unknown |= {*hypothesis.bounds} - names - {*hypothesis.release}
    unknown |= {*started, *hypothesis.follow.values()} - names - present
    if unknown:
        return f"it names {', '.join(sorted(unknown))}: say parameters that are there and vary"
    return None


def _find_misfit(hypothesis: Hypothesis, scene: Scene) -> str | None:
    """Return what is wrong with the changes of Parts and their slopes at the start."""
    machine, campaign = scene.model.machine, scene.session.campaign
    laplace = np.asarray(2j * np.pi * campaign.freq_hz[campaign.freq_hz > 0], complex)
    starts = list_start_values(hypothesis, scene)
    lines = laplace[[0, len(laplace) // 2, -1]]
    for part in hypothesis.parts:
        names = [parameter.name for parameter in part.parameters]
        theta = np.array([starts[name] for name in names])
        # At the start most Parts change nothing, so that slopes are compared a step away.
        size = float(np.cbrt(np.finfo(float).eps))
        step = np.full(len(names), size)
        middle = np.array(
            [np.clip(starts[n] + size, *hypothesis.bounds.get(n, (-np.inf, np.inf))) for n in names]
        )
        for condition in {test.condition: None for test in campaign.tests}:
            at = PartContext(machine, condition)
            for slope in part.slopes(theta, at):
                if fault := _find_unfit(slope, (len(names),), machine, laplace):
                    return f"of a slope {fault}"
            for change in part.changes(middle, at):
                if fault := _find_unfit(change, (), machine, laplace):
                    return f"of a change {fault}"
            ahead, behind = (part.changes(middle + sign * step, at) for sign in (1, -1))
            moved = [
                replace(slope, core=np.tensordot(step, slope.core, 1))
                for slope in part.slopes(middle, at)
            ]
            if _differ(
                scene.settings.slope_tolerance,
                *(_sum_stiffness(changes, lines) for changes in (ahead, behind, moved)),
            ):
                return "its slopes are not those of its change: derive them anew"
    return None


def _sum_stiffness(changes: Sequence[Change], laplace: Complex) -> dict[tuple[str, str], Complex]:
    """Return the dynamic stiffness of all changes of a slot and point; (n_line, n, m) each."""
    stiffness: dict[tuple[str, str], Complex] = {}
    for change in changes:
        powers = laplace[:, None] ** np.arange(3)
        if change.shape is not None:
            powers = powers * change.shape(laplace)[:, None]
        core = np.einsum("fk,krt->frt", powers, change.core)
        key = change.slot, str(change.point)
        stiffness[key] = stiffness.get(key, 0.0) + change.left @ core @ change.right.T
    return stiffness


def _differ(
    tolerance: float,
    ahead: dict[tuple[str, str], Complex],
    behind: dict[tuple[str, str], Complex],
    moved: dict[tuple[str, str], Complex],
) -> bool:
    """Return whether central differences and slopes differ by more than a relative tolerance."""
    for key in {*ahead, *behind, *moved}:
        first, second, slope = (at.get(key, np.zeros(1)) for at in (ahead, behind, moved))
        off = np.abs((first - second) / 2 - slope).max()
        if off > tolerance * np.abs(slope).max() + HALF_PRECISION * np.abs(first).max():
            return True
    return False


def _find_unfit(
    change: Change, lead: tuple[int, ...], machine: Machine, laplace: Complex
) -> str | None:
    """Return what is wrong with a change; ``lead`` are leading axes of its core."""
    bodies, joints = len(machine.body_mass), len(machine.coordinates)
    sizes = {
        "body": (bodies, bodies),
        "joint": (joints, joints),
        "path": (bodies, joints),
        "sensor": (6, bodies),
        "hammer": (6, bodies),
        "input": (1, 1),
        "output": (6, 1),
    }
    is_known = (
        change.slot not in ("sensor", "hammer", "output") or change.point in machine.layout.points
    )
    if change.slot not in sizes or not is_known:
        return (
            f"the slot is {change.slot!r} and the point {change.point!r}: say one of "
            f"{', '.join(sizes)}, of a sensor, hammer or output with a point of the machine"
        )
    left, right, core = (
        np.asarray(each, float) for each in (change.left, change.right, change.core)
    )
    rows, columns = sizes[change.slot]
    if left.ndim != 2 or right.ndim != 2 or (len(left), len(right)) != (rows, columns):
        return (
            f"the frames are {left.shape} and {right.shape}, expected ({rows}, r) and "
            f"({columns}, t) in the slot {change.slot} of this machine"
        )
    expected = (*lead, 3, left.shape[1], right.shape[1])
    if core.shape != expected:
        return f"the core is {core.shape}, expected {expected}"
    if not all(np.isfinite(each).all() for each in (left, right, core)):
        return "a frame or the core holds nan or infinity: all must be finite"
    if change.shape is not None:
        values = np.asarray(change.shape(laplace))
        if values.shape != laplace.shape or not np.isfinite(values).all():
            return f"the shape gives {values.shape} values, expected {laplace.shape} finite ones"
    return None


def list_start_values(hypothesis: Hypothesis, scene: Scene) -> dict[str, float]:
    """Return the start values of all parameters [SI] of a fit of the hypothesis, by name."""
    fitted = zip(scene.model.parameters, scene.theta.tolist(), strict=True)
    starts = {parameter.name: value for parameter, value in fitted}
    starts |= {parameter.name: 0.0 for part in hypothesis.parts for parameter in part.parameters}
    starts |= hypothesis.begin
    return starts | {name: starts[target] for name, target in hypothesis.follow.items()}


def read_numbers(stated: Any) -> dict[str, Value]:
    """Return finite numbers and vectors by name; None is a component that nothing shows.

    Raises:
        ValueError: another value.
    """
    numbers: dict[str, Value] = {}
    for name, value in dict(stated).items():
        array = np.asarray(value, float)  # None is nan
        unknown = [part is None for part in value] if isinstance(value, tuple) else False
        if not (isinstance(name, str) and array.ndim < 2 and (np.isfinite(array) | unknown).all()):
            raise ValueError(f"{name!r} is {value!r}, expected a finite number or a vector of them")
        vector = value if isinstance(value, tuple) else tuple(np.ravel(array).tolist())
        numbers[name] = vector if array.ndim else float(array)
    return numbers
