"""Modes of a machine before and after something is put on it, as a table of text and of HTML."""

from dataclasses import dataclass
from html import escape

from identification.modal.indicators import mac, pair_shapes
from identification.words import Real
from mbmodel import weighted_motions
from mbw.predict.machines import Additions
from mbw.prediction import Prediction


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """A prediction of a machine alone and with additions.

    Args:
        before: of the machine alone.
        after: of the combined machine.
        additions: what was put on it.
        prefix: of the stage's names.
        criterion: MAC of the modes on the common bodies; (n_before, n_after).
        pairs: numbers of the modes that are alike, before and after.
    """

    before: Prediction
    after: Prediction
    additions: Additions
    prefix: str
    criterion: Real
    pairs: tuple[tuple[int, int], ...]

    @property
    def new(self) -> list[int]:
        """Modes of the combined machine without a partner."""
        partners = {after for _, after in self.pairs}
        return [k for k in range(len(self.after.modes.poles)) if k not in partners]

    @property
    def gone(self) -> list[int]:
        """Modes of the machine alone without a partner."""
        partners = {before for before, _ in self.pairs}
        return [k for k in range(len(self.before.modes.poles)) if k not in partners]


def compare(
    before: Prediction, after: Prediction, additions: Additions, prefix: str
) -> BeforeAfter:
    """Pair the modes of a machine alone with those of the combined machine."""
    layouts = before.machine.layout, after.machine.layout
    bodies = [body for body in layouts[0].bodies if body in layouts[1].bodies]
    motions = [
        weighted_motions(prediction.machine, prediction.modes, bodies, before.machine)
        for prediction in (before, after)
    ]
    criterion = mac(*motions)
    return BeforeAfter(before, after, additions, prefix, criterion, tuple(pair_shapes(criterion)))


def frequency_change(comparison: BeforeAfter, before: int, after: int) -> float | None:
    """Return the relative change of a natural frequency; None for a mode at rest before."""
    if comparison.before.is_at_rest(before):
        return None
    start = float(comparison.before.modes.freq_hz[before])
    return float(comparison.after.modes.freq_hz[after]) / start - 1.0


def comparison_table(comparison: BeforeAfter) -> list[str]:
    """Return the modes before and after as lines of text."""
    head = ("before", "Hz", "damping/%", "after", "Hz", "damping/%", "change/%", "MAC")
    rows = [head, *_cells(comparison)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
    lines = [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    return [f"before and after {comparison.additions}:", *lines]


def comparison_section(comparison: BeforeAfter) -> str:
    """Return HTML of the modes before and after."""
    head = (
        '<th colspan="3">before</th><th colspan="3">after</th>'
        '<th rowspan="2">change of<br>frequency / %</th>'
        '<th rowspan="2" title="of the motions of the common bodies, weighted by mass">MAC</th>'
        "</tr><tr><th>mode</th><th>Hz</th><th>ζ / %</th><th>mode</th><th>Hz</th><th>ζ / %</th>"
    )
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>"
        for row in _cells(comparison)
    )
    return (
        f"<h2>Before and after</h2><p>{escape(str(comparison.additions))}. The combined machine "
        "is in <code>combined.xml</code> beside this page. Modes with a MAC of 0.5 or more are "
        "partners.</p>"
        f'<div class="scroll"><table class="tight"><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _cells(comparison: BeforeAfter) -> list[tuple[str, ...]]:
    """Return the cells of all rows by rising frequency after; modes that are gone come last."""
    partner = {after: before for before, after in comparison.pairs}
    rows: list[tuple[str, ...]] = []
    for after in range(len(comparison.after.modes.poles)):
        before = partner.get(after)
        right = _mode_cells(comparison.after, after)
        if before is None:
            rows.append(("", "new", "", *right, "", ""))
            continue
        change = frequency_change(comparison, before, after)
        cells = _mode_cells(comparison.before, before)
        shift = "" if change is None else f"{100 * change:+.2f}"
        rows.append((*cells, *right, shift, f"{comparison.criterion[before, after]:.3f}"))
    empty = ("", "gone", "", "", "")
    return rows + [(*_mode_cells(comparison.before, k), *empty) for k in comparison.gone]


def _mode_cells(prediction: Prediction, number: int) -> tuple[str, str, str]:
    """Return number, frequency and damping of a mode."""
    frequency = float(prediction.modes.freq_hz[number])
    return str(number + 1), f"{frequency:.3f}", prediction.damping_words[number]
