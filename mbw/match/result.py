"""Result of ``mbw match``, collected once for its files, its table and its page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.impacts import ImpactCampaign, ImpactSpectra
from identification.matching import (
    ModeCircles,
    ModeMatch,
    RatioReference,
    channel_geometry,
    choose_reference,
    estimate_by_hand,
    fit_mode_circles,
    match_by_ratios,
)
from identification.readers.result_files import (
    read_result_arrays,
    read_result_json,
    write_result_arrays,
)
from identification.shapes import MassCheck, RigidModes, Shapes, distinguish_modes
from identification.words import Integers
from mbw.match.circles import circle_arrays, circle_row
from mbw.match.schema import MassRow, MatchFile, MatchRow

MATCH_JSON, MATCH_NPZ, PAGE = "match.json", "match.npz", "match.html"
NAMES = MATCH_JSON, MATCH_NPZ, PAGE
_MAX_DISTINGUISHING_CHANNELS = 3  # channels that are listed for a pair of similar modes
_MIN_CHANNEL_MOTION = 1e-3  # over the largest motion of a mode; below, no channel observes it
_ZERO_PADDING = 8  # interpolated frequency lines for each independent line, to read widths


@dataclass(frozen=True, eq=False)
class MatchResult:
    """Match of measured and simulated modes with everything that its files and its page show.

    Args:
        summary: names, modes and pairs, as in match.json.
        arrays: arrays by name, as in match.npz.
    """

    summary: MatchFile
    arrays: dict[str, Any]


def collect_result(
    shapes: Shapes,
    rigid: RigidModes,
    campaign: ImpactCampaign,
    match: ModeMatch,
    width_hz: float,
    mass: MassCheck | None = None,
) -> MatchResult:
    """Collect the result of a match.

    Args:
        shapes: all simulated shapes, those of rigid modes too.
        rigid: division of these into rigid and elastic modes.
        campaign: campaign of impacts.
        match: match of the measured modes with the elastic ones.
        width_hz: width of the sliding average of amplitudes [Hz].
        mass: comparison with a stated mass; None without one.
    """
    spectra = campaign.spectra(_ZERO_PADDING)
    number = shapes.numbers[rigid.supported]
    circles = [
        fit_mode_circles(spectra, match.measured, mode)
        for mode in range(len(match.measured.frequencies))
    ]
    rows = [
        _row(match, spectra, mode, number, circles[mode])
        for mode in range(len(match.measured.frequencies))
    ]
    summary = _summary(shapes, rigid, campaign, spectra, match, rows)
    summary.mass_check = None if mass is None else _mass_row(mass, shapes.source)
    readings: tuple[RatioReference, ...] = ("reference", "largest")
    printed, largest = (
        match_by_ratios(
            spectra,
            match.simulated_shapes,
            summary.reference,
            reading=reading,
            width_hz=width_hz,
        )
        for reading in readings
    )
    places, axes = channel_geometry(campaign.layout, spectra.dofs)
    shown = _shown_modes(summary)
    columns = [int(np.flatnonzero(number == mode)[0]) for mode in shown]
    vectors = shapes.vectors[rigid.supported][columns]
    arrays = {
        "freq_hz": spectra.freq_hz,
        "numbers": number,
        "simulated_hz": match.simulated_hz,
        "at": match.simulated_shapes,
        "probability": match.probability,
        "mac": match.mac,
        "shown": np.array(shown, np.intp),
        "shown_hz": match.simulated_hz[columns],
        "places": np.array(printed.places),
        "amplitude": printed.amplitude,
        "ratios": printed.simulated[columns],
        "closeness": printed.closeness[:, columns],
        "closeness_largest": largest.closeness[:, columns],
        "points": shapes.points.astype(np.float32),
        "triangles": shapes.triangles.astype(np.int32),
        "vectors": vectors.astype(np.float32),
        "channel_places": places,
        "channel_axes": axes,
    } | circle_arrays(circles, spectra)
    return MatchResult(summary, arrays)


def _shown_modes(summary: MatchFile) -> list[int]:
    """Return the simulated modes of the page: matched ones, and unmatched ones in the band."""
    matched = {row.simulated for row in summary.modes if row.simulated is not None}
    return sorted(matched | set(summary.unmatched))


def _summary(
    shapes: Shapes,
    rigid: RigidModes,
    campaign: ImpactCampaign,
    spectra: ImpactSpectra,
    match: ModeMatch,
    rows: list[MatchRow],
) -> MatchFile:
    number = shapes.numbers[rigid.supported]
    names = [str(dof) for dof in spectra.dofs]
    band = (match.simulated_hz >= campaign.band[0]) & (match.simulated_hz <= campaign.band[1])
    unmatched = [int(number[k]) for k in np.flatnonzero(band) if k not in match.pairs.values()]
    at_channels = match.simulated_shapes[band]
    in_band, similarity = number[band], distinguish_modes(at_channels)
    vectors = shapes.vectors[rigid.supported][band]
    motion = np.abs(at_channels).max(axis=1, initial=0.0) / np.abs(vectors).max(axis=(1, 2))
    return MatchFile(
        shapes=shapes.source,
        campaign=str(campaign.path),
        band=list(campaign.band),
        lines=len(spectra.freq_hz) // _ZERO_PADDING,
        mass=rigid.mass if rigid.is_mass_normalised else None,
        channels=names,
        impacts=list(spectra.sources),
        modes=rows,
        unmatched=unmatched,
        alike=[[int(in_band[i]), int(in_band[j])] for i, j in similarity.confused],
        alike_told_by=[
            [names[k] for k in best[:_MAX_DISTINGUISHING_CHANNELS]] for best in similarity.channels
        ],
        unseen=[
            int(n) for n, size in zip(in_band, motion, strict=True) if size < _MIN_CHANNEL_MOTION
        ],
        reference=choose_reference(
            at_channels if band.any() else match.simulated_shapes, spectra.dofs
        ),
    )


def _row(
    match: ModeMatch, spectra: ImpactSpectra, mode: int, number: Integers, circles: ModeCircles
) -> MatchRow:
    names = [str(dof) for dof in spectra.dofs]
    pair = match.pairs.get(mode)
    no_match = 1 - float(match.probability[mode].sum())
    return MatchRow(
        frequency=float(match.measured.frequencies[mode]),
        frequency_sd=float(match.measured.frequency_sd[mode]),
        damping=float(match.measured.dampings[mode]),
        damping_sd=float(match.measured.damping_sd[mode]),
        simulated=None if pair is None else int(number[pair]),
        simulated_frequency=None if pair is None else float(match.simulated_hz[pair]),
        probability=no_match if pair is None else float(match.probability[mode, pair]),
        mac=None if pair is None else float(match.mac[mode, pair]),
        telling=[names[channel] for channel in match.telling_channels(mode)],
        shape=match.measured.shapes[mode].tolist(),
        by_hand=list(estimate_by_hand(spectra, match.measured, mode)),
        circles=[
            circle_row(channel, spectra.sources[circles.impact]) for channel in circles.channels
        ],
    )


def _mass_row(mass: MassCheck, source: str) -> MassRow:
    return MassRow(
        stated=mass.stated,
        tolerance=mass.tolerance,
        agrees=mass.agrees,
        remark=mass.remark(Path(source).name),
    )


def write_result(result: MatchResult, folder: Path) -> None:
    """Write all files but the page into an existing folder."""
    (folder / MATCH_JSON).write_text(result.summary.model_dump_json(indent=1) + "\n", "utf-8")
    write_result_arrays(folder / MATCH_NPZ, result.arrays)


def read_result(path: Path) -> MatchResult:
    """Read the result that ``mbw match`` wrote.

    Args:
        path: folder of the result, or its match.json.

    Raises:
        InputError: a file is missing, broken or of another version.
    """
    folder = path if path.is_dir() else path.parent
    summary = read_result_json(folder / MATCH_JSON, MatchFile, "mbw match")
    return MatchResult(summary, read_result_arrays(folder / MATCH_NPZ, "mbw match"))
