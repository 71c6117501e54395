"""Lines of an error budget on the terminal and on its page."""

from collections.abc import Sequence

from mbw.page.numbers import format_percent
from mbw.plant.margin_sentences import margin_lines
from mbw.plant.schema import BudgetRow, ErrorRow, ShareOfPoleRow

_MAX_SHOWN_SHARES = 4  # of sources, modes, joints and springs in a line
_MIN_SHOWN_SHARE_OF_ERROR = 0.01
_MIN_MODE_HZ = 1e-4  # slower poles are what rounding leaves of motions that nothing holds


def budget_lines_of_text(row: BudgetRow, units: Sequence[float]) -> list[str]:
    """Return a budget as lines of text.

    Args:
        row: of the budget.
        units: SI value of the unit of each error.
    """
    loops = f", loops closed: {', '.join(row.loops)}" if row.loops else ""
    lines = [f"error budget, {row.band[0]:g} to {row.band[1]:g} Hz{loops}:"]
    lines += [f"  {remark}" for remark in row.remarks]
    for error, unit in zip(row.errors, units, strict=True):
        lines += [f"  {headline(error, unit)}", *(f"    {text}" for text in _details(error, unit))]
    return lines if row.margins is None else [*lines, *margin_lines(row.margins)]


def headline(error: ErrorRow, unit: float) -> str:
    """Return the rms of an error, its interval and that of the other machine."""
    text = f"{error.name} = {error.signal}: {error.rms / unit:.4g} {error.unit} rms"
    if error.low is not None and error.high is not None:
        text += f" (95 %: {error.low / unit:.4g} to {error.high / unit:.4g})"
    if error.before is not None:
        text += f"; before {error.before / unit:.4g} {error.unit}"
    return text


def _details(error: ErrorRow, unit: float) -> list[str]:
    """Return the largest shares of an error, and what changes it most."""
    sources = sorted(error.sources, key=lambda share: -share.share)
    rows = [
        ("sources", [(share.name, share.share) for share in sources]),
        ("cross terms", [(share.name, share.share) for share in error.cross_terms]),
        ("modes", [(mode_name(mode), mode.share) for mode in error.modes]),
        ("joints", [(share.name, share.share) for share in error.joints]),
    ]
    texts = []
    for title, shares in rows:
        shown = [
            f"{name} {format_percent(share)}"
            for name, share in shares[:_MAX_SHOWN_SHARES]
            if abs(share) >= _MIN_SHOWN_SHARE_OF_ERROR
        ]
        if shown:
            texts.append(f"{title}: {', '.join(shown)}")
    touches = [
        f"{touch.parameter} {touch.change / unit:+.3g} {error.unit}"
        for touch in error.touches[:_MAX_SHOWN_SHARES]
    ]
    return [*texts, *([f"10 % more of: {', '.join(touches)}"] if touches else [])]


def mode_name(mode: ShareOfPoleRow) -> str:
    """Return frequency and damping of a mode in words."""
    if mode.frequency < _MIN_MODE_HZ:
        return "free motion (0 Hz)"
    if mode.damping >= 1:
        return f"real pole at {mode.frequency:.4g} Hz"
    return f"{mode.frequency:.4g} Hz ({format_percent(mode.damping)})"


def cause_sentences(row: BudgetRow, units: Sequence[float], causes: Sequence[str]) -> list[str]:
    """Return what the causes of a diagnosis cost each error.

    Args:
        row: of the machine with the causes; the other machine is the one without them.
        units: SI value of the unit of each error.
        causes: their names.
    """
    names, verb = " and ".join(causes), "costs" if len(causes) == 1 else "cost"
    sentences = []
    for error, unit in zip(row.errors, units, strict=True):
        if error.before is None:
            continue
        change = (error.rms - error.before) / unit
        if change >= 0:
            text = f"{names} {verb} {change:.3g} of {error.rms / unit:.4g} {error.unit}"
        else:
            text = (
                f"with {names} the error is {-change:.3g} {error.unit} smaller, "
                f"{error.rms / unit:.4g} {error.unit}"
            )
        sentences.append(f"{error.name}: {text}")
    return sentences
