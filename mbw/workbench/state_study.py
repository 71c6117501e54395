"""Margins of the control loops and error budget of a state, beside those of the machine as drawn.

They take longer than a frame, and are computed for a state that rests.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import InputError, Loop, Real
from mbmodel import Model, with_loops
from mbw.workbench.edits import delay_loops
from mbw.workbench.state import SessionState
from mbw.workbench.subject import WorkbenchSubject
from tuning.control_loops.loops_file import known_loops
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_plant import LoopPlant, loops_alone
from tuning.plant.error_budget.read_definition import read_definition
from tuning.toleranced_model import machine_alone

_MARGINS = ("crossover", "phase", "gain", "delay", "modulus")


@dataclass(eq=False)
class StateStudy:
    """Loops and budget of one subject, whatever its state.

    Args:
        subject: without edits.
        budget: budget.toml, whose loops then count; None for the margins of the known loops alone.
    """

    subject: WorkbenchSubject
    budget: Path | None = None
    _kept: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Loops whose margins are computed, without what edits add to them.

        Raises:
            InputError: a file cannot be used.
        """
        return self._define(self.subject).loops

    @property
    def is_wanted(self) -> bool:
        """Whether there is anything to compute."""
        return self.budget is not None or bool(self.loops)

    def study(self, subject: WorkbenchSubject, state: SessionState) -> dict[str, Any]:
        """Return margins and errors of a state, each beside that of the machine as drawn.

        Args:
            subject: with the edits of the state.
            state: whose parameters count.

        Returns:
            ``loops`` and ``errors`` as rows with ``drawn`` and ``current``, and ``sentences`` on
            what cannot be computed.
        """
        drawn = SessionState(state.campaign, state.model, state.view)
        before, now = self._compute(self.subject, drawn), self._compute(subject, state)
        rows: dict[str, Any] = {"key": state.key, "sentences": now["sentences"]}
        for kind in ("loops", "errors"):
            rows[kind] = [
                {"name": name, "drawn": before[kind].get(name), "current": now[kind].get(name)}
                for name in dict.fromkeys([*before[kind], *now[kind]])
            ]
        return rows

    def _define(self, subject: WorkbenchSubject) -> BudgetDefinition:
        """Return errors, sources and loops, with the delays that edits add."""
        machine = with_loops(subject.model.machine, ())
        if self.budget is not None:
            definition = read_definition(self.budget, machine)
        else:
            ends = float(subject.freq_hz[subject.freq_hz > 0][0]), float(subject.freq_hz[-1])
            definition = loops_alone(known_loops(subject.source, machine), ends)
        loops = delay_loops(definition.loops, subject.edits)
        return replace(definition, loops=loops)

    def _compute(self, subject: WorkbenchSubject, state: SessionState) -> dict[str, Any]:
        """Return margins and errors of one state; the last few states are kept."""
        content = b"" if self.budget is None else self.budget.read_bytes()
        name = f"{state.structure} {state.coordinates} {hash(content)}"
        if name not in self._kept:
            if len(self._kept) > 50:
                self._kept.clear()
            self._kept[name] = self._compute_anew(subject, state)
        return self._kept[name]

    def _compute_anew(self, subject: WorkbenchSubject, state: SessionState) -> dict[str, Any]:
        result: dict[str, Any] = {"loops": {}, "errors": {}, "sentences": []}
        model = machine_alone(subject.model)
        model = Model(with_loops(model.machine, ()), model.parts)
        theta = _values_of(model, subject, state)
        definition = self._define(subject)
        try:
            if definition.loops:
                plant = LoopPlant.of(model, definition)
                result["loops"] = _margin_rows(plant, theta)
            if self.budget is not None:
                budget = error_budget(model, theta, definition)
                for error, rms in zip(definition.errors, budget.rms.tolist(), strict=True):
                    unit, size = definition.units[error.name]
                    result["errors"][error.name] = {"rms": rms / size, "unit": unit}
        except InputError as error:
            result["sentences"].append(str(error))
        return result


def _values_of(model: Model, subject: WorkbenchSubject, state: SessionState) -> Real:
    """Return the parameters of the machine alone [SI]; (n_parameter,)."""
    varies = subject.parametrisation
    theta = varies.theta(state.x(varies.names))
    values = {p.name: v for p, v in zip(varies.parameters, theta.tolist(), strict=True)}
    return np.array([values[parameter.name] for parameter in model.parameters])


def _margin_rows(plant: LoopPlant, theta: Real) -> dict[str, dict[str, Any]]:
    """Return the margins of each loop by its name; empty numbers where the loops are unstable."""
    names = [loop.name for loop in plant.definition.loops]
    poles = plant.poles(theta, is_closed=True)
    growing = growing_pole(poles)
    if growing is not None:
        hertz = abs(growing.imag) / (2 * np.pi)
        return {name: {"unstable": float(hertz)} for name in names}
    margins = plant.margins(theta, plant.poles(theta, is_closed=False), poles)
    return {name: loop.state(_MARGINS) for name, loop in zip(names, margins.loops, strict=True)}
