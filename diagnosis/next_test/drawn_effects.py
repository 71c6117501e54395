"""Effects of a test in their shapes and directions, each of any size.

Score tests scan the shapes of an effect, such as the frequency of an appendage, and free the
coordinates of its direction. Each shape is taken in directions drawn in these coordinates.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene, find_no_direction
from diagnosis.next_test.linear_search import LinearSearch
from diagnosis.search.linearised_fit import find_signed
from diagnosis.stated_values import Value
from identification.words import Integers, Real


def propose_linear(scene: Scene) -> list[Hypothesis]:
    """Return the hypotheses of a score test that a linear change of the FRFs describes."""
    return [
        hypothesis
        for effect in load_catalogue().values()
        for hypothesis in effect(scene)
        if hypothesis.spring is None and hypothesis.member is None
        if hypothesis.correct is None or is_sign(hypothesis)
    ]


def select_shapes(shapes: Sequence[Hypothesis], count: int) -> list[Hypothesis]:
    """Return some shapes of an effect, evenly from its scan without the ends out of the band."""
    places = np.arange(0.5, count) * len(shapes) / count
    return [shapes[k] for k in np.unique(places.astype(int))]


def is_sign(hypothesis: Hypothesis) -> bool:
    """Return whether a correction of the data is that of a sign, a gain of -1."""
    return hypothesis.correct is not None and hypothesis.effect == "sensor_polarity"


@dataclass(frozen=True, eq=False)
class SizedEffect:
    """Effect of size one, with d' Q d = 1.

    Args:
        moved: d; (n,).
        size: its size, by which shapes and directions are compared.
        dof: its direction in the verdict; empty without one.
        hidden: length of its vector over that of the components that show.
        is_sized: whether it may have another size.
    """

    hypothesis: Hypothesis
    moved: Real
    size: float = 1.0
    dof: str = ""
    hidden: float = 1.0
    is_sized: bool = True


@dataclass(frozen=True, eq=False)
class DrawnEffects:
    """Effects of a test."""

    scene: Scene
    linear: LinearSearch

    def draw(self, shapes: Sequence[Hypothesis]) -> list[SizedEffect]:
        """Return directions of all shapes that some channel shows, the smallest size first.

        Where a size may have either sign, as added and missing mass, it is positive.
        """
        random = np.random.default_rng(0)
        directions = self.scene.settings.predicted_directions
        drawn: list[SizedEffect] = []
        for hypothesis in select_shapes(shapes, self.scene.settings.predicted_shapes):
            chosen = self.linear.find_coordinates(hypothesis)
            square = self.linear.projected[np.ix_(chosen, chosen)]
            for along in _draw_directions(hypothesis, random, directions):
                moved, dof = np.zeros(self.linear.whole.size), hypothesis.dof or ""
                moved[chosen] = along
                strength = float(np.sqrt(max(float(along @ square @ along), 0.0)))
                if is_sign(hypothesis):
                    moved *= self._invert(chosen)
                    drawn.append(SizedEffect(hypothesis, moved, dof=dof, is_sized=False))
                elif strength > np.finfo(float).eps * np.sqrt(np.trace(square)):
                    effect = SizedEffect(hypothesis, moved / strength, dof=dof)
                    axis = hypothesis.along(self._map_fitted(effect, 1.0)) or dof
                    drawn += self._measure_size(replace(effect, dof=axis), random)
        positive = [effect for effect in drawn if effect.size >= 0]
        return sorted(positive or drawn, key=lambda effect: abs(effect.size))

    def _invert(self, chosen: Integers) -> float:
        """Return the coordinate of a gain at which it is -1."""
        varies = self.linear.varies
        place = int(np.flatnonzero(varies.coordinate_of == chosen[0])[0])
        return float((-1 - varies.fixed[place]) / varies.scale[place])

    def is_within_bounds(self, effect: SizedEffect, size: float) -> bool:
        """Return whether a fit may find an effect of a size."""
        fitted = self._map_fitted(effect, size)
        return all(
            low <= fitted[name] <= high for name, (low, high) in effect.hypothesis.bounds.items()
        )

    def _measure_size(self, effect: SizedEffect, random: np.random.Generator) -> list[SizedEffect]:
        """Return an effect with its size, by the first parameter that follows it.

        It is the inverse of a parameter that a larger effect lowers, as a frequency or stiffness.
        Components of a vector that no motion shows have any direction too, so that a single
        component that shows is one of several effects.
        """
        parameter, value = self.state_size(effect, 1.0)
        if value is None:
            return [replace(effect, size=float(np.linalg.norm(effect.moved)))]
        none = self._state(effect, 0.0).get(parameter, 0.0)
        if 0 < value < self._state(effect, 0.5)[parameter]:
            return [replace(effect, size=1 / value)]
        stated = effect.hypothesis.state(self._map_fitted(effect, 1.0))[parameter]
        components = stated if isinstance(stated, tuple) else (stated,)
        is_shown = np.array([component is not None for component in components])
        if is_shown.all():
            return [replace(effect, size=value - none)]
        count = self.scene.settings.predicted_directions
        count = count if len(effect.hypothesis.coordinates) == 1 else 1
        squares = random.standard_normal((count, len(components))) ** 2
        lengths = np.sqrt(squares.sum(axis=1) / squares[:, is_shown].sum(axis=1)).tolist()
        return [replace(effect, size=hidden * value, hidden=hidden) for hidden in lengths]

    def state_size(self, effect: SizedEffect, size: float) -> tuple[str, float | None]:
        """Return the first parameter of the verdict that follows the size, and its value."""
        whole, half = (self._state(effect, part * size) for part in (1.0, 0.5))
        for name, value in whole.items():
            if value != half.get(name):
                return name, value
        return "", None

    def _state(self, effect: SizedEffect, size: float) -> dict[str, float]:
        """Return the parameters of the verdict at a size, each as one number."""
        stated = effect.hypothesis.state(self._map_fitted(effect, size))
        return {name: effect.hidden * _find_number(name, value) for name, value in stated.items()}

    def _map_fitted(self, effect: SizedEffect, size: float) -> dict[str, float]:
        """Return the parameters of a fit that finds an effect of a size [SI]."""
        whole, hypothesis = self.linear.whole, effect.hypothesis
        theta, numbers = whole.theta(size * effect.moved), self._numbers
        names = [p.name for p in self.scene.model.parameters]
        names += [p.name for part in hypothesis.parts for p in part.parameters]
        start = {k: v for k, v in hypothesis.begin.items() if k not in hypothesis.coordinates}
        return dict(zip(names, theta[[numbers[k] for k in names]].tolist(), strict=True)) | start

    @cached_property
    def _numbers(self) -> dict[str, int]:
        """Number of each parameter by its name."""
        return {p.name: number for number, p in enumerate(self.linear.whole.parameters)}


def _find_number(name: str, value: Value) -> float:
    """Return a number, the length of a vector, or the smallest fraction that a support carries."""
    if not isinstance(value, tuple):
        return float(value)
    numbers = [number for number in value if number is not None]
    return min(numbers) if name == "fraction" else float(np.linalg.norm(numbers))


def _draw_directions(
    hypothesis: Hypothesis, random: np.random.Generator, count: int
) -> Iterator[Real]:
    """Yield directions of the scored coordinates, in their units; (n_coordinate,)."""
    names = hypothesis.coordinates
    free = np.array([name not in hypothesis.believed for name in names])
    if len(names) == 1:
        yield free.astype(float)
        return
    if hypothesis.along is not find_no_direction:  # each coordinate has a direction of its own
        yield from np.eye(len(names))[free]
        return
    is_signed = find_signed(hypothesis)
    for along in random.standard_normal((count, len(names))):
        direction = np.where(is_signed, np.abs(along), along) * free
        yield direction / np.linalg.norm(direction)
