"""Stability margins in words, on the terminal and in the table of the page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from mbw.page.html import badge
from mbw.page.numbers import format_digits, format_percent
from mbw.plant.margin_schema import (
    LoopMarginsRow,
    MarginRow,
    MarginsRow,
    StepRow,
    VariantRow,
)
from tuning.plant.error_budget.robust_stability import RobustTest

ALL_LOOPS = "all loops at once"


@dataclass(frozen=True)
class _Shown:
    """How a margin is shown: its name, unit, number from its value in the JSON file, or absence."""

    name: str
    unit: str = ""
    number: Callable[[float], float] = float
    absent: str = "no limit"

    def value(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{self.bare(value)}{self.unit}"

    def bare(self, value: float) -> str:
        """Return a value without its unit."""
        digits = 4 if self.unit == " Hz" else 3
        return f"{self.number(value):.{digits}g}"


def _decibels(factor: float) -> float:
    """Return a gain in decibels."""
    return 20 * float(np.log10(factor))


_MODULUS = _Shown("modulus")
_SHOWN_MARGINS = (
    _Shown("crossover", " Hz", absent="none"),
    _Shown("bandwidth", " Hz", absent="none"),
    _Shown("gain", " dB", _decibels),
    _Shown("gain reduction", " dB", _decibels),
    _Shown("phase", "°"),
    _Shown("delay", " ms", lambda seconds: 1e3 * seconds),
    _MODULUS,
)


def margin_lines(row: MarginsRow) -> list[str]:
    """Return the margins as lines of text."""
    lines = [f"stability margins{interval_note(row)}:"]
    for loop in row.loops:
        lines.append(f"  loop {_loop_title(loop)}:")
        lines += [f"    {text}" for text in _loop_texts(loop)]
    if row.all_loops is not None:
        both = row.all_loops
        lines.append(f"  {ALL_LOOPS}:")
        lines.append(f"    modulus {_with_interval(both.modulus, _MODULUS)}, units scaled out")
        lines.append(f"    modulus {_with_interval(both.singular, _MODULUS)}, in SI units")
        lines += [f"    {robust_sentence(test)}" for test in both.robust]
    return [*lines, *(f"  {variant_text(each)}" for each in row.variants)]


def interval_note(row: MarginsRow) -> str:
    """Return what the intervals of margins hold; empty without any."""
    if not row.machines:
        return ""
    has_floor = any(margin.floor is not None for loop in row.loops for margin in _margins(loop))
    return f", over {row.machines} machines of the posterior" + (
        " and the model-error floor" if has_floor else "; no model error showed beside the noise"
    )


def variant_text(row: VariantRow) -> str:
    """Return whether the loops are stable in a model or pose of a test, with their margins."""
    if row.growing_pole is not None:
        return f"{row.variant}: unstable, a pole at {row.growing_pole:.4g} Hz grows"
    texts = []
    for loop in row.loops:
        values = (None, None, loop.gain, None, loop.phase, loop.delay, loop.modulus)
        shown = [
            f"{shown.name} {shown.value(value)}"
            for shown, value in zip(_SHOWN_MARGINS, values, strict=True)
            if value is not None
        ]
        texts.append(f"{loop.loop} {', '.join(shown)}")
    some = f"; unstable in {row.unstable_machines} machines of the posterior"
    return f"{row.variant}: {'; '.join(texts)}{some if row.unstable_machines else ''}"


def _loop_title(loop: LoopMarginsRow) -> str:
    """Return the name of a loop, with its sampling period."""
    return loop.loop if loop.period is None else f"{loop.loop}, sampled every {loop.period:g} s"


def _loop_texts(loop: LoopMarginsRow) -> list[str]:
    """Return the margins of a loop, one text for each."""
    pairs = list(zip(_SHOWN_MARGINS, _margins(loop), strict=True))
    texts = [
        f"{shown.name} {_with_interval(margin, shown)}"
        for shown, margin in pairs
        if margin.value is not None
    ]
    if not texts:
        return ["the loop has no gain, so that it has no margins"]
    texts[-1] += f"; |S| is at most {loop.sensitivity_peak:.3g}"
    for absent in ("none", "no limit"):
        missing = [
            shown.name for shown, margin in pairs if margin.value is None and shown.absent == absent
        ]
        if missing:
            texts.append(f"{absent}: {', '.join(missing)}")
    if loop.step is not None:
        texts.append(step_sentence(loop.step))
    return [*texts, *(robust_sentence(test) for test in loop.robust)]


def step_sentence(step: StepRow) -> str:
    """Return overshoot and times of a step of the reference."""
    rise, settling = (
        "none" if time is None else f"{format_digits(1e3 * time, 3)} ms"
        for time in (step.rise_time, step.settling_time)
    )
    return (
        f"step of the reference: overshoot {format_percent(step.overshoot)}, rise time {rise}, "
        f"settling time to 2 % {settling}, final value {step.final:.4g}"
    )


def robust_sentence(test: RobustTest) -> str:
    """Return whether a loop is stable for all plants within a weight, as far as it is known."""
    low, high = test.band
    if test.robustly_stable is None:
        start, end = test.wanted_band
        return (
            f"not known to be stable for all such plants: W, the {test.weight}, is known from "
            f"{low:.3g} to {high:.3g} Hz only, and the loop crosses |L| = 1 or peaks in |T| at "
            f"{_outside(test)}: test from {start:.3g} to {end:.3g} Hz; |W T| is at most "
            f"{test.peak:.3g}, at {test.frequency:.4g} Hz"
        )
    verdict = "robustly stable" if test.holds else "not shown to be stable for all such plants"
    return (
        f"{verdict}: |W T| is at most {test.peak:.3g}, at {test.frequency:.4g} Hz, W the "
        f"{test.weight}, known from {low:.3g} to {high:.3g} Hz"
    )


def _outside(test: RobustTest) -> str:
    """Return the critical frequencies at which the weight is not known."""
    return f"{', '.join(f'{each:.4g}' for each in test.outside)} Hz"


def margin_table(row: MarginsRow) -> str:
    """Return HTML of the table of margins: a column per loop, and one for all at once."""
    names = [_loop_title(loop) for loop in row.loops]
    columns = [[*_cells(loop), _robust_cell(loop.robust)] for loop in row.loops]
    if row.all_loops is not None:
        names.append(ALL_LOOPS)
        both = row.all_loops
        empty = ["-"] * (len(_SHOWN_MARGINS) - 1)
        columns.append([*empty, _cell(both.modulus, _MODULUS), _robust_cell(both.robust)])
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    titles = [*(shown.name for shown in _SHOWN_MARGINS), "largest |W T|"]
    body = "".join(
        f"<tr><td class='name'>{title}</td>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
        for title, *cells in zip(titles, *columns, strict=True)
    )
    return (
        f"<div class='scroll'><table class='tight margins'><thead><tr><th class='name'>loop</th>"
        f"{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _cells(loop: LoopMarginsRow) -> list[str]:
    """Return the cells of a loop."""
    return [
        _cell(margin, shown) for margin, shown in zip(_margins(loop), _SHOWN_MARGINS, strict=True)
    ]


def _robust_cell(tests: Sequence[RobustTest]) -> str:
    """Return HTML of the largest |W T| of each weight; a dash without any."""
    texts = (
        f"{badge(f'{test.peak:.3g}', good=test.robustly_stable)}"
        f"<br><small>{escape(test.weight)}, at {test.frequency:.4g} Hz"
        f"{f'; W is not known at {_outside(test)}' if test.outside else ''}</small>"
        for test in tests
    )
    return "<br>".join(texts) or "-"


def _cell(margin: MarginRow, shown: _Shown) -> str:
    """Return a margin, its frequency, interval and worst value as HTML."""
    if margin.value is None:
        return shown.absent
    text = escape(shown.value(margin.value))
    if (at := _frequency(margin)) is not None:
        text += f" <small>{at}</small>"
    ends = "; ".join(_ends(margin, shown))
    return f"{text}<br><small>{escape(ends)}</small>" if ends else text


def _with_interval(margin: MarginRow, shown: _Shown) -> str:
    """Return a margin with its frequency, interval and worst value."""
    if margin.value is None:
        return shown.absent
    text = " ".join(filter(None, (shown.value(margin.value), _frequency(margin))))
    ends = "; ".join(_ends(margin, shown))
    return f"{text} ({ends})" if ends else text


def _frequency(margin: MarginRow) -> str | None:
    """Return the frequency of a margin that is none itself."""
    if margin.frequency is None or margin.frequency == margin.value:
        return None
    return f"at {margin.frequency:.4g} Hz"


def _ends(margin: MarginRow, shown: _Shown) -> list[str]:
    """Return the interval, the worst value and that of the other machine, where they are known."""
    before = [] if margin.before is None else [f"before {shown.value(margin.before)}"]
    if margin.low is None and margin.high is None:
        return before
    low = shown.absent if margin.low is None else shown.bare(margin.low)
    high = shown.absent if margin.high is None else shown.value(margin.high)
    is_frequency = margin.frequency == margin.value
    has_worst = margin.worst is not None and not is_frequency
    worst = [f"worst {shown.value(margin.worst)}"] if has_worst and margin.worst else []
    return [f"95 %: {low} to {high}", *worst, *before]


def _margins(loop: LoopMarginsRow) -> tuple[MarginRow, ...]:
    """Return the margins in the order of the table."""
    return (
        loop.crossover,
        loop.bandwidth,
        loop.gain,
        loop.gain_reduction,
        loop.phase,
        loop.delay,
        loop.modulus,
    )
