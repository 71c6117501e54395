r"""What limits the gain of a loop: its modes, a notch for each, and what to change on the machine.

The largest gain with a modulus margin is the least one that a line forbids (``allowed_gains``),
from the gain on that one starts with: that of the loop if it is stable, else zero if the open loop
is. The lines belong to the nearest mode of the machine, and the least gain among them is what that
mode allows. How it changes with the machine is in ``gain_changes``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, Loop, Real, percent_text
from mbmodel import (
    Model,
    energy_shares,
    model_modes,
    system_poles,
)
from tuning.control_loops.stability import growing_pole
from tuning.plant.control_loops.allowed_gains import (
    allowed_gains,
    crossover_of,
    notch_response,
    refine_lines,
)
from tuning.plant.control_loops.loop_gain_lines import (
    follow_loop_gain,
    single_loop_gains,
)
from tuning.plant.control_loops.stability_margins import LoopMargins
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.gain_changes import GainLimit, gain_changes
from tuning.plant.error_budget.loop_plant import LoopPlant

_MAX_NOTCH_RATIO = 0.5  # a shallower notch would not be one
_MIN_NAMED_SHARE = 0.1  # of the energy of a mode, for a part that is named
_SHOWN_CHANGES = 3  # of each mode, in words
_NEAR_MODE = 1.3  # ratio of frequencies within which a line belongs to a mode
_MAX_ALLOWED_GAIN = 100.0  # a mode that allows more does not limit


@dataclass(frozen=True, eq=False)
class LimitingMode:
    """A mode that limits the gain of a loop.

    Args:
        freq_hz, damping: of the mode of the machine.
        gain: factor by which the loop's gain may rise as far as this mode is concerned.
        at_hz: line where it is reached [Hz].
        springs, bodies: parts with most of its strain and kinetic energy, and their shares.
        notch: ratio d of a notch at the mode; None where it would have to be too shallow.
        notch_phase_deg: phase that it costs at the crossover, negative.
        notch_crossover_hz: largest crossover of the loop with the notch; NaN if it has none.
        changes: relative change of ``gain`` for each change of the machine, the strongest first.
    """

    freq_hz: float
    damping: float
    gain: float
    at_hz: float
    springs: dict[str, float]
    bodies: dict[str, float]
    notch: float | None
    notch_phase_deg: float
    notch_crossover_hz: float
    changes: dict[str, float]


@dataclass(frozen=True, eq=False)
class LoopDesign:
    """A loop, stable or not, and what limits it.

    Args:
        loop: its name.
        pole: that grows with all loops closed [rad/s]; None if none does.
        margins: None if the loops are unstable.
        freq_hz: lines [Hz]; (n_freq,).
        gains: L, all other loops closed; (n_freq,).
        modulus: margin that is asked for.
        gain: largest factor of the gain with that margin; NaN if no gain has it.
        crossover_hz: crossover there [Hz].
        samples_hz: the same of machines of the posterior; empty without one; (n_sample,).
        sample_gains: L of these machines; (n_sample, n_freq).
        modes: that limit the gain, the most severe first.
    """

    loop: str
    pole: complex | None
    margins: LoopMargins | None
    freq_hz: Real
    gains: Complex
    modulus: float
    gain: float
    crossover_hz: float
    samples_hz: Real
    sample_gains: Complex
    modes: tuple[LimitingMode, ...]

    @property
    def sensitivity(self) -> Complex:
        """S = 1 / (1 + L); (n_freq,)."""
        return np.asarray(1 / (1 + self.gains))

    @property
    def is_limited(self) -> bool:
        """Whether some gain has the margin that is asked for, and a crossover there."""
        return bool(np.isfinite(self.gain))

    def sentences(self) -> list[str]:
        """Return margins, the largest crossover, and each mode with its remedies, in words."""
        if self.pole is None:
            return [f"{self.loop}: {self.margins!r}", *self.limit_sentences()]
        at = abs(self.pole.imag) / (2 * np.pi)
        return [f"{self.loop}: unstable, the pole at {at:.4g} Hz grows", *self.limit_sentences()]

    def limit_sentences(self) -> list[str]:
        """Return the largest gain and crossover of the loop, and what limits them, in words."""
        if not self.is_limited:
            return []
        text = (
            f"with a modulus margin of {self.modulus:g} the gain of {self.loop} may be "
            f"{self.gain:.3g} times as large"
        )
        if np.isfinite(self.crossover_hz):
            text += f", and the crossover {self.crossover_hz:.4g} Hz"
        if len(self.samples_hz) and np.isfinite(self.samples_hz).any():
            low, high = np.nanquantile(self.samples_hz, (0.025, 0.975))
            text += f" ({low:.4g} to {high:.4g} Hz for 95 % of the machines)"
        lines = [text]
        if not any(mode.gain < self.gain * _NEAR_MODE for mode in self.modes):
            lines.append("no mode of the machine limits it, but the phase of the loop")
        for mode in self.modes:
            parts = mode.springs | mode.bodies
            held = ", ".join(f"{name} {100 * share:.0f} %" for name, share in parts.items())
            lines.append(
                f"mode at {mode.freq_hz:.4g} Hz ({held}): gain at most {mode.gain:.3g} times"
            )
            if mode.notch is not None and np.isfinite(mode.notch_crossover_hz):
                lines.append(
                    f"  a notch of {mode.notch:.2g} there changes the phase at the crossover by "
                    f"{mode.notch_phase_deg:.2g} deg; the crossover may then be "
                    f"{mode.notch_crossover_hz:.4g} Hz"
                )
            lines += [
                f"  {name}: {'+' * (change >= 0)}{percent_text(change)} of the gain"
                for name, change in list(mode.changes.items())[:_SHOWN_CHANGES]
            ]
        return lines


def design_loops(
    model: Model,
    definition: BudgetDefinition,
    modulus: float = 0.5,
    thetas: Sequence[Real] = (),
) -> tuple[LoopDesign, ...]:
    """Return what limits each loop of a definition, stable or not.

    Args:
        model: of the machine, without loops, at its nominal values.
        definition: with loops.
        modulus: margin that is asked for; 0.5 bounds |S| by 2.
        thetas: parameters of machines of the posterior; (n_theta,) each.
    """
    plant, theta = LoopPlant.of(model, definition), model.drawn
    closed = plant.poles(theta, is_closed=True)
    opened = plant.poles(theta, is_closed=False)
    pole = growing_pole(closed)
    margins = plant.margins(theta, opened, closed) if pole is None else None
    gain_of, lines = plant.gain_at(theta), plant.lines_near(opened, closed)
    freq, gains = refine_lines(gain_of, *follow_loop_gain(gain_of, lines), modulus)
    known = [loop.controller for loop in definition.loops]
    controllers = [system_poles(each.dynamics, each.period_s) for each in known]
    start = 1.0 if pole is None else 0.0
    is_known = pole is None or growing_pole(np.concatenate([opened, *controllers])) is None
    single = single_loop_gains(gains)
    drawn = [single_loop_gains(plant.gain_at(each)(freq)) for each in thetas]
    designs = []
    for number, loop in enumerate(definition.loops):
        curve = single[:, number]
        allowed = allowed_gains(curve, modulus, start)
        gain = float(allowed.min()) if is_known else float("nan")
        if not np.isfinite(gain) or _grows(plant, loop, gain):
            gain = float("nan")
        samples = [
            crossover_of(
                freq, each[:, number], allowed_gains(each[:, number], modulus, start).min()
            )
            for each in drawn
        ]
        crossover = crossover_of(freq, curve, gain)
        modes: tuple[LimitingMode, ...] = ()
        if np.isfinite(gain):
            modes = _limiting_modes(plant, loop, (freq, curve), modulus, gain, crossover)
        designs.append(
            LoopDesign(
                loop.name,
                pole,
                None if margins is None else margins.loops[number],
                freq,
                curve,
                modulus,
                gain,
                crossover,
                np.array(samples),
                np.array([each[:, number] for each in drawn]).reshape(-1, len(freq)),
                modes,
            )
        )
    return tuple(designs)


def _limiting_modes(
    plant: LoopPlant,
    loop: Loop,
    curve: tuple[Real, Complex],
    modulus: float,
    largest: float,
    crossover_hz: float,
) -> tuple[LimitingMode, ...]:
    """Return the modes of the machine that limit a loop, the most severe first."""
    (freq, gains), model = curve, plant.model
    modes = model_modes(model, model.drawn)
    shares = energy_shares(model, model.drawn, modes)
    numbers = np.flatnonzero(modes.oscillates)
    allowed = allowed_gains(gains, modulus, largest)
    distance = np.abs(np.log(freq[:, None] / modes.freq_hz[numbers]))
    nearest = np.where(distance.min(axis=1) < np.log(_NEAR_MODE), distance.argmin(axis=1), -1)
    kinetic = shares.by_body()
    limiting = []
    for column, number in enumerate(numbers):
        lines = np.flatnonzero(nearest == column)
        if not len(lines) or not allowed[lines].min() < _MAX_ALLOWED_GAIN:
            continue
        line = int(lines[np.argmin(allowed[lines])])
        gain = float(allowed[line])
        rest = float(np.min(np.append(allowed[nearest != column], 4 * gain)))
        ratio = (1 - modulus) / (max(rest, 2 * gain) * np.abs(gains[line]))
        place = float(modes.freq_hz[number])
        notch = ratio if ratio <= _MAX_NOTCH_RATIO else None
        through = notch_response(freq, place, notch or 1.0)
        with_notch = gains * through
        reached = float(allowed_gains(with_notch, modulus, largest).min())
        turns = [
            np.angle(curve[1:] / curve[:-1]).sum()
            for curve in (1 + largest * gains, 1 + reached * with_notch)
        ]
        if not abs(turns[1] - turns[0]) < np.pi / 2:  # it encircles -1 otherwise
            reached = float("nan")
        cost = notch_response(np.array([crossover_hz]), place, notch or 1.0)
        limit = GainLimit(
            float(freq[line]), complex(gains[line]), gain, place, modes.shapes[:, number]
        )
        limiting.append(
            LimitingMode(
                place,
                float(modes.damping[number]),
                gain,
                float(freq[line]),
                _largest(dict(zip(shares.springs, shares.strain[:, number], strict=True))),
                _largest({body: values[number] for body, values in kinetic.items()}),
                notch,
                float(np.degrees(np.angle(cost[0]))),
                crossover_of(freq, with_notch, reached),
                gain_changes(plant, loop, limit),
            )
        )
    return tuple(sorted(limiting, key=lambda mode: mode.gain))


def _grows(plant: LoopPlant, loop: Loop, gain: float) -> bool:
    """Return whether the loops are unstable with the gain of one of them multiplied."""
    known = loop.controller
    output, through = gain * known.output_matrix, gain * known.feedthrough
    scaled = replace(loop, controller=replace(known, output_matrix=output, feedthrough=through))
    loops = tuple(scaled if each is loop else each for each in plant.definition.loops)
    changed = replace(plant, definition=replace(plant.definition, loops=loops))
    return growing_pole(changed.poles(plant.model.drawn, is_closed=True)) is not None


def _largest(shares: dict[str, float]) -> dict[str, float]:
    """Return the parts with most of an energy, the largest first."""
    order = sorted(shares, key=lambda name: -abs(shares[name]))[:2]
    return {name: float(shares[name]) for name in order if abs(shares[name]) >= _MIN_NAMED_SHARE}
