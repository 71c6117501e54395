"""``mbw predict --struts``: damping by force feedback, and frames that decouple."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from identification.words import UsageError, capitalise
from mbmodel import Model
from mbw.page.html import pack_real
from mbw.page.numbers import format_percent
from mbw.plant.schema import FeedbackRow, FramesRow, StrutsRow
from tuning.plant.damping.force_feedback import ForceFeedback, RootLocus, force_feedback
from tuning.plant.damping.frames import StrutFrames, find_struts, strut_frames
from tuning.plant.error_budget.machine_files import FittedMachine

_POSTERIOR_MACHINES, _MACHINE_SEED = 40, 1  # samples of the interval of the damping ratio
_FRAME_LINES = 200
_MAX_LISTED_SETS_OF_STRUTS = 6
_MAX_DRAWN_LOCI = 5


@dataclass(frozen=True, eq=False)
class StrutsResult:
    """Damping and decoupling of struts.

    Args:
        feedback: loci of the target mode.
        frames: of the platform; None without six struts.
        row: for the JSON file.
    """

    feedback: ForceFeedback
    frames: StrutFrames | None
    row: StrutsRow

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        row = self.row
        lines = [
            f"integral force feedback -g / (s + w_l), leak at {row.leak_hz:.4g} Hz; target mode "
            f"{row.target_hz:.4g} Hz, damping {format_percent(row.target_damping)}, "
            f"{format_percent(row.share)} of its strain energy in the struts:"
        ]
        for number, each in enumerate(row.sets[:_MAX_LISTED_SETS_OF_STRUTS]):
            interval = ""
            if number == 0 and row.interval is not None:
                low, high = row.interval
                interval = f" (95 %: {format_percent(low)} to {format_percent(high)})"
            lines.append(
                f"  {', '.join(each.struts)}: damping {format_percent(each.damping)}{interval} at "
                f"{each.frequency:.4g} Hz, g = {each.gain:.4g} rad/s, static stiffness "
                f"{format_percent(each.static_stiffness)}"
            )
        return [*lines, *_frame_lines(row)]

    def section(self) -> str:
        """Return HTML of the section of the page."""
        head, *rest = self.lines()
        items = "".join(f"<li>{escape(line.strip())}</li>" for line in rest)
        return (
            f"<h2>Damping and decoupling</h2><p>{escape(capitalise(head))}</p>"
            f'<ul class="plain">{items}</ul><div class="pair"><div><h3>Root locus of the target '
            'mode</h3><div id="locus"></div></div><div><h3>Coupling in each frame</h3>'
            '<div id="coupling"></div></div></div>'
            '<p class="soft">Crosses: without feedback; circles: at the best gain. Coupling: '
            "largest |G_ij| / sqrt(|G_ii G_jj|) of two directions of the struts' plant.</p>"
        )

    def data(self) -> dict[str, object]:
        """Return the data of the script."""
        frames = self.frames
        return {
            "loci": [_locus_data(locus) for locus in self.feedback.loci[:_MAX_DRAWN_LOCI]],
            "frames": None
            if frames is None
            else {
                "freq": pack_real(frames.freq_hz),
                "names": list(frames.coupling),
                "coupling": [pack_real(values) for values in frames.coupling.values()],
            },
        }


def compute_struts(
    model: Model, path: Path, patterns: Sequence[str], band: tuple[float, float]
) -> StrutsResult:
    """Compute damping and decoupling.

    Args:
        model: nominal model of the machine with the struts.
        band: of the coupling [Hz].

    Raises:
        UsageError: a name of no strut.
    """
    fitted = FittedMachine.read(model, path)
    model, posterior = fitted.model, fitted.posterior
    thetas = None if posterior is None else posterior.sample(_POSTERIOR_MACHINES, _MACHINE_SEED)
    feedback = force_feedback(model, model.drawn, tuple(patterns), thetas=thetas)
    frames, reason = None, ""
    try:
        struts = find_struts(model, model.drawn, patterns)
        low, high = max(band[0], band[1] * 1e-4), band[1]
        frames = strut_frames(model, model.drawn, struts, np.geomspace(low, high, _FRAME_LINES))
    except UsageError as error:
        reason = str(error)
    row = StrutsRow(
        target_hz=feedback.target_hz,
        target_damping=feedback.target_damping,
        share=feedback.share,
        leak_hz=feedback.leak_hz,
        sets=[_feedback_row(feedback, locus) for locus in feedback.loci],
        interval=feedback.interval(),
        frames=None if frames is None else _frames_row(frames),
        no_frames=reason,
    )
    return StrutsResult(feedback, frames, row)


def _feedback_row(feedback: ForceFeedback, locus: RootLocus) -> FeedbackRow:
    """Return the row of one set of struts."""
    best = locus.best
    return FeedbackRow(
        struts=list(locus.struts),
        gain=float(locus.gain[best]),
        damping=float(locus.damping[best]),
        frequency=float(abs(locus.poles[best]) / (2 * np.pi)),
        static_stiffness=feedback.static_share(locus),
    )


def _frames_row(frames: StrutFrames) -> FramesRow:
    """Return the row of the frames."""
    return FramesRow(
        body=frames.body,
        centre_of_mass=frames.centre_of_mass.tolist(),
        centre_of_stiffness=frames.centre_of_stiffness.tolist(),
        jacobian_mass=frames.jacobians["centre of mass"].tolist(),
        jacobian_stiffness=frames.jacobians["centre of stiffness"].tolist(),
        coupling_low={name: float(values[0]) for name, values in frames.coupling.items()},
        coupling_high={name: float(values[-1]) for name, values in frames.coupling.items()},
    )


def _frame_lines(row: StrutsRow) -> list[str]:
    """Return lines on the frames."""
    frames = row.frames
    if frames is None:
        return [f"  no frames: {row.no_frames}"]
    places = {
        "centre of mass": frames.centre_of_mass,
        "centre of stiffness": frames.centre_of_stiffness,
    }
    lines = [f"  frames of {frames.body}, largest coupling at low and at high frequency:"]
    for name, low in frames.coupling_low.items():
        at = f" ({', '.join(f'{x:.4f}' for x in places[name])}) m" if name in places else ""
        high = frames.coupling_high[name]
        lines.append(f"    {name}{at}: {format_percent(low)}, {format_percent(high)}")
    return lines


def _locus_data(locus: RootLocus) -> dict[str, object]:
    """Return a locus for the script [Hz]."""
    poles = locus.poles / (2 * np.pi)
    best = locus.best
    return {
        "name": ", ".join(locus.struts),
        "x": poles.real.tolist(),
        "y": poles.imag.tolist(),
        "best": [float(poles[best].real), float(poles[best].imag)],
        "gain": locus.gain.tolist(),
    }
