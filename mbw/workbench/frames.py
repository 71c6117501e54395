"""Frames of the page: every number and curve of one state, as bytes that the page draws at once.

A frame is a header in JSON, preceded by its length, and arrays in single precision. All of it comes
from one state. Frames are kept by the state's hash, up to a number of bytes.
"""

import json
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identification.modal import mac
from identification.words import Complex, Dof, Real, UsageError
from mbmodel import Evaluator, FrfRequest, ModeEvaluator, Modes, parse_input, parse_output
from mbmodel.ports.port_units import input_unit, output_unit
from mbw.workbench.state import SessionState, View
from mbw.workbench.subject import WorkbenchSubject
from tuning import channel_gaps, predict, summarise_gaps
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalCost
from tuning.misfit.weights import squared_size

MAX_FRAME_BYTES = 64 * 2**20  # of all frames that are kept: some thousand states
_MIN_ALIKE_MAC = 0.5  # below it no mode of the drawing is named as the one that became this mode

_Arrays = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class _Drawn:
    """The model as drawn and without edits, with which every state is compared."""

    theta: Real
    modes: Modes
    mass_root: Real
    weighted_shapes: Complex
    gap: dict[str, float | None]
    predicted: tuple[Complex, ...]


@dataclass(eq=False)
class FrameMaker:
    """Maker of the frames of one subject, with those that are kept.

    Args:
        subject: model, tests and results.
        max_bytes: bytes of the frames that are kept.
        nominal: maker of the subject without edits; None if this is it.
    """

    subject: WorkbenchSubject
    max_bytes: int = MAX_FRAME_BYTES
    nominal: "FrameMaker | None" = None
    _kept: OrderedDict[str, bytes] = field(default_factory=OrderedDict)
    _pairs: dict[tuple[str, str], tuple[Evaluator, Complex | None]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Compute what every frame compares with."""
        subject = self.subject
        model, measured = subject.model, subject.measured_modes
        self._pairing = (
            ModalCost(model, measured, MODAL_STAGES[-1])
            if measured is not None and len(measured.poles)
            else None
        )
        bodies = self.body_dofs
        self._n_body_dofs = len(bodies)
        channels = () if self._pairing is None else self._pairing.outputs
        self._modes = ModeEvaluator(model, (*bodies, *channels))
        self._mass_root = _mass_root(model.machine.body_mass)
        self._drawn: _Drawn = self._draw() if self.nominal is None else self.nominal._drawn
        # Motions of the bodies that the drawing has, by which modes are compared with its own.
        compared = bodies if self.nominal is None else self.nominal.body_dofs
        self._compared = [bodies.index(dof) for dof in compared]

    def _draw(self) -> _Drawn:
        """Return what every state is compared with."""
        varies = self.subject.parametrisation
        theta = varies.theta(np.zeros(varies.size))
        linearised, predicted = self._modes.at(theta), self._predict(theta)
        shapes = self._mass_root @ linearised.shapes[: self._n_body_dofs]
        gap = self._gap(predicted)
        return _Drawn(theta, linearised.modes, self._mass_root, shapes, gap, predicted)

    @property
    def body_dofs(self) -> tuple[Dof, ...]:
        """Motions of all bodies; (6 n_body,)."""
        return self.subject.model.machine.layout.body_dofs()

    @property
    def kept_bytes(self) -> int:
        """Bytes of all frames that are kept."""
        return sum(map(len, self._kept.values()))

    def has_ports(self, view: View) -> bool:
        """Return whether the machine has both ends of a frequency response."""
        machine = self.subject.model.machine
        try:
            parse_output(machine, view.channel)
            parse_input(machine, self.subject.find_port(view.reference))
        except UsageError:
            return False
        return True

    def make(self, state: SessionState) -> bytes:
        """Return the frame of a state, computed or kept.

        Raises:
            UsageError: the state looks at a channel that the machine does not have.
        """
        key = state.key
        if key not in self._kept:
            self._kept[key] = encode_frame(*self._compute(state))
            while self.kept_bytes > self.max_bytes and len(self._kept) > 1:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]

    def _compute(self, state: SessionState) -> tuple[dict[str, Any], _Arrays]:
        """Return header and arrays of a state."""
        varies = self.subject.parametrisation
        theta = varies.theta(state.x(varies.names))
        linearised = self._modes.at(theta)
        predicted = self._predict(theta)
        modes, shapes = linearised.modes, linearised.shapes
        number = min(state.view.mode, len(modes.poles))
        shape = shapes[: self._n_body_dofs, number - 1] if number else np.zeros(self._n_body_dofs)
        header = {
            "key": state.key,
            "view": vars(state.view),
            "x": dict(state.coordinates),
            "gap": self._gap(predicted),
            "drawn_gap": self._drawn.gap,
            "modes": self._mode_rows(modes, shapes),
            "unit": self._unit(state),
            "structure": state.structure,
            "machine": state.machine_key,
            "edits": [edit.model_dump() for edit in state.edits],
        }
        curves = self._curves(state, theta, predicted)
        return header, {**curves, "shape": shape.astype(complex)}

    def _predict(self, theta: Real) -> tuple[Complex, ...]:
        """Return the model's answer to every test."""
        campaign = self.subject.campaign
        return () if campaign is None else predict(self.subject.model, theta, campaign)

    def _gap(self, predicted: tuple[Complex, ...]) -> dict[str, float | None]:
        """Return error and excess over all channels; empty without a test."""
        if self.subject.campaign is None:
            return {}
        gap = summarise_gaps(channel_gaps(predicted, self.subject.campaign))
        return {"error": gap.error, "excess": gap.excess, "noise": gap.noise}

    def _curves(self, state: SessionState, theta: Real, predicted: tuple[Complex, ...]) -> _Arrays:
        """Return the curves of the FRF that the page looks at."""
        subject, view = self.subject, state.view
        cell = _find_cell(subject, view.reference, view.channel)
        if cell is None:
            evaluator, drawn = self._pair(view.reference, view.channel)
            current = {"current": evaluator.at(theta).values[:, 0, 0]}
            return current if drawn is None else {"drawn": drawn, **current}
        number, row = cell
        estimate = subject.campaign.tests[number].estimate  # type: ignore[union-attr]
        curves: _Arrays = {
            "measured": estimate.frf.values[:, row, 0],
            "deviation": np.sqrt(estimate.variance[:, row, 0]),
            "drawn": self._drawn.predicted[number][:, row, 0],
            "current": predicted[number][:, row, 0],
        }
        if estimate.coherence is not None:
            curves["coherence"] = estimate.coherence[:, row, 0]
        for name, frfs in subject.stored.items():
            column = frfs.column.get((view.reference, view.channel))
            if column is not None:
                curves[name] = frfs.values[:, column]
        return curves

    def _pair(self, reference: str, channel: str) -> tuple[Evaluator, Complex | None]:
        """Return the evaluator of an FRF that was not measured, and its values as drawn.

        The latter are None if the machine as drawn lacks an end of it, which an edit adds.
        """
        if (reference, channel) not in self._pairs:
            subject, machine = self.subject, self.subject.model.machine
            request = FrfRequest(
                subject.freq_hz,
                (parse_output(machine, channel),),
                (parse_input(machine, subject.find_port(reference)),),
                subject.quantity,
            )
            evaluator = Evaluator(subject.model, request)
            drawn: Complex | None = None
            if self.nominal is None:
                drawn = evaluator.at(self._drawn.theta).values[:, 0, 0]
            else:
                with suppress(UsageError):
                    drawn = self.nominal._pair(reference, channel)[1]
            self._pairs[reference, channel] = evaluator, drawn
        return self._pairs[reference, channel]

    def _unit(self, state: SessionState) -> str:
        """Return the unit of the FRF that the page looks at."""
        machine, view = self.subject.model.machine, state.view
        output = output_unit(machine, parse_output(machine, view.channel), self.subject.quantity)
        port = parse_input(machine, self.subject.find_port(view.reference))
        return f"{output}/{input_unit(machine, port)}"

    def _mode_rows(self, modes: Modes, shapes: Complex) -> list[dict[str, Any]]:
        """Return a row for each mode, with the drawing's mode that is most like it.

        Args:
            modes: modes of the state.
            shapes: their motion at the bodies and at the measured channels; (n_out, n_mode).
        """
        drawn, split = self._drawn, self._n_body_dofs
        compared, whole = drawn.mass_root @ shapes[self._compared], self._mass_root @ shapes[:split]
        # A mode whose energy is in an added body resembles none, however its carrier moves.
        share = squared_size(compared).sum(axis=0) / squared_size(whole).sum(axis=0)
        alike = mac(compared, drawn.weighted_shapes) * np.minimum(share, 1.0)[:, None]
        partners = self._partners(modes, shapes[split:])
        rows = []
        for k, pole in enumerate(modes.poles.tolist()):
            nearest, oscillates = int(np.argmax(alike[k])), pole.imag > 0
            is_alike = oscillates and alike[k, nearest] >= _MIN_ALIKE_MAC
            row: dict[str, Any] = {
                "name": modes.names[k],
                "frequency": float(modes.freq_hz[k]),
                "damping": float(modes.damping[k]) if oscillates else None,
                "drawn": float(drawn.modes.freq_hz[nearest]) if is_alike else None,
            }
            rows.append({**row, **partners.get(k, {})})
        return rows

    def _partners(self, modes: Modes, shapes: Complex) -> dict[int, dict[str, float]]:
        """Return measured frequency, damping and MAC by the number of the mode that is paired."""
        measured = self.subject.measured_modes
        if measured is None or self._pairing is None:
            return {}
        pairs = self._pairing.pair_modes(modes, shapes)
        oscillating = np.flatnonzero((modes.poles.imag > 0) & (modes.poles.real < 0))
        return {
            int(oscillating[k]): {
                "measured": float(measured.freq_hz[number]),
                "measured_damping": float(measured.damping[number]),
                "mac": float(pairs.mac[number]),
            }
            for number, k in enumerate(pairs.partner.tolist())
            if k >= 0
        }


def _mass_root(mass: Real) -> Real:
    """Return W with W'W = M, so that the MAC of W phi counts motions by the energy they carry."""
    tiny = 1e-12 * float(np.diag(mass).max())  # of a body without mass
    return np.asarray(np.linalg.cholesky(mass + tiny * np.eye(len(mass))).T, np.float64)


def _find_cell(subject: WorkbenchSubject, reference: str, channel: str) -> tuple[int, int] | None:
    """Return the numbers of the test and of its output that were measured; None if not."""
    if reference not in subject.tests or subject.campaign is None:
        return None
    number = subject.tests.index(reference)
    estimate = subject.campaign.tests[number].estimate
    labels = [str(dof) for dof in estimate.frf.outputs]
    if channel not in labels or not estimate.measured[labels.index(channel), 0]:
        return None
    return number, labels.index(channel)


def encode_frame(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return a frame: length of the header, header in JSON, arrays in single precision.

    The header names each array with its first number and its count; complex arrays hold real and
    imaginary parts in turn.

    Args:
        header: content that JSON can hold.
        arrays: arrays by name.
    """
    places, parts, first = {}, [], 0
    for name, values in arrays.items():
        kind = "<c8" if np.iscomplexobj(values) else "<f4"
        numbers = np.ascontiguousarray(values, kind).view("<f4").ravel()
        places[name] = [first, len(numbers)]
        parts.append(numbers.tobytes())
        first += len(numbers)
    text = json.dumps({**header, "arrays": places}).encode()
    text += b" " * (-len(text) % 4)
    return len(text).to_bytes(4, "little") + text + b"".join(parts)
