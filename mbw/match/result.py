"""What ``mbw match`` found, gathered once for its files, its table and its page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from pydantic import ValidationError

from identification.impacts import ImpactCampaign, ImpactSpectra
from identification.matching import (
    ByHand,
    Match,
    Reading,
    by_hand,
    channels_at,
    printed_match,
    steadiest,
)
from identification.shapes import RigidModes, Shapes, telling
from identification.words import InputError, Integers
from mbw.match.schema import HandRow, MatchFile, MatchRow

MATCH_JSON, MATCH_NPZ, PAGE = "match.json", "match.npz", "match.html"
NAMES = MATCH_JSON, MATCH_NPZ, PAGE
_TELLING = 3  # channels that tell modes that are alike
_UNSEEN = 1e-3  # of a mode's largest motion, what no channel tells from none
_FINER = 8  # lines to look at, and to measure widths by, for one that is independent


@dataclass(frozen=True, eq=False)
class Result:
    """A match and what is shown beside it.

    Args:
        summary: names, modes, pairs.
        arrays: numbers by name, as in match.npz.
    """

    summary: MatchFile
    arrays: dict[str, Any]


def gather(
    whole: Shapes,
    rigid: RigidModes,
    campaign: ImpactCampaign,
    found: Match,
    width_hz: float,
) -> Result:
    """Put together what was found.

    Args:
        whole: shapes, rigid ones too.
        rigid: which of them are.
        campaign: of impacts.
        found: the match with the shapes that are held.
        width_hz: of the sliding average of amplitudes.
    """
    spectra = campaign.spectra(_FINER)
    number = np.flatnonzero(rigid.held) + 1
    summary = _summary(whole, rigid, campaign, spectra, found)
    readings: tuple[Reading, ...] = ("reference", "largest")
    printed, largest = (
        printed_match(spectra, found.at, summary.reference, reading=reading, width_hz=width_hz)
        for reading in readings
    )
    places, axes = channels_at(campaign.layout, spectra.dofs)
    shown = _shown(summary)
    own = [int(np.flatnonzero(number == one)[0]) for one in shown]
    vectors = whole.vectors[np.array(shown, np.intp) - 1]
    arrays = {
        "freq_hz": spectra.freq_hz,
        "numbers": number,
        "simulated_hz": found.simulated_hz,
        "at": found.at,
        "probability": found.probability,
        "mac": found.mac,
        "shown": np.array(shown, np.intp),
        "shown_hz": found.simulated_hz[own],
        "places": np.array(printed.places),
        "amplitude": printed.amplitude,
        "ratios": printed.simulated[own],
        "closeness": printed.impacts[:, own],
        "closeness_largest": largest.impacts[:, own],
        "points": whole.points.astype(np.float32),
        "triangles": whole.triangles.astype(np.int32),
        "vectors": vectors.astype(np.float32),
        "channel_places": places,
        "channel_axes": axes,
    }
    return Result(summary, arrays)


def _shown(summary: MatchFile) -> list[int]:
    """Simulated modes that the page shows: those that were measured, or might have been."""
    matched = {row.simulated for row in summary.modes if row.simulated is not None}
    return sorted(matched | set(summary.unmatched))


def _summary(
    whole: Shapes,
    rigid: RigidModes,
    campaign: ImpactCampaign,
    spectra: ImpactSpectra,
    found: Match,
) -> MatchFile:
    number = np.flatnonzero(rigid.held) + 1
    names = [str(dof) for dof in spectra.dofs]
    band = (found.simulated_hz >= campaign.band[0]) & (found.simulated_hz <= campaign.band[1])
    left = [int(number[k]) for k in np.flatnonzero(band) if k not in found.pairs.values()]
    own, told = number[band], telling(found.at[band])
    vectors = whole.vectors[own - 1]
    moved = np.abs(found.at[band]).max(axis=1, initial=0.0) / np.abs(vectors).max(axis=(1, 2))
    return MatchFile(
        shapes=whole.source,
        campaign=str(campaign.path),
        band=list(campaign.band),
        lines=len(spectra.freq_hz) // _FINER,
        mass=rigid.mass if rigid.normalised else None,
        channels=names,
        impacts=list(spectra.sources),
        modes=[
            _row(found, spectra, mode, number, names)
            for mode in range(len(found.measured.frequencies))
        ],
        unmatched=left,
        alike=[[int(own[i]), int(own[j])] for i, j in told.confused],
        alike_told_by=[[names[k] for k in best[:_TELLING]] for best in told.channels],
        unseen=[int(n) for n, size in zip(own, moved, strict=True) if size < _UNSEEN],
        reference=steadiest(found.at[band] if band.any() else found.at, spectra.dofs),
    )


def _row(
    found: Match, spectra: ImpactSpectra, mode: int, number: Integers, names: list[str]
) -> MatchRow:
    pair = found.pairs.get(mode)
    none = 1 - float(found.probability[mode].sum())
    return MatchRow(
        frequency=float(found.measured.frequencies[mode]),
        frequency_sd=float(found.measured.frequency_sd[mode]),
        damping=float(found.measured.dampings[mode]),
        damping_sd=float(found.measured.damping_sd[mode]),
        simulated=None if pair is None else int(number[pair]),
        simulated_frequency=None if pair is None else float(found.simulated_hz[pair]),
        probability=none if pair is None else float(found.probability[mode, pair]),
        mac=None if pair is None else float(found.mac[mode, pair]),
        telling=[names[channel] for channel in found.channels(mode)],
        shape=found.measured.shapes[mode].tolist(),
        by_hand=[_hand(one, spectra) for one in by_hand(spectra, found.measured, mode)],
    )


def _hand(one: ByHand, spectra: ImpactSpectra) -> HandRow:
    return HandRow(
        channel=str(one.dof),
        impact=spectra.sources[one.impact],
        lower=one.lower,
        peak=one.peak,
        upper=one.upper,
        damping=one.damping,
        least_squares=one.least_squares,
        maximum=one.maximum,
    )


def write_result(result: Result, folder: Path) -> None:
    """Write all but the page into a folder that is there."""
    (folder / MATCH_JSON).write_text(result.summary.model_dump_json(indent=1) + "\n", "utf-8")
    np.savez_compressed(folder / MATCH_NPZ, allow_pickle=False, **result.arrays)


def read_result(path: Path) -> Result:
    """Read a result back.

    Args:
        path: its folder, or the match.json in it.

    Raises:
        InputError: a file is missing or of another program.
    """
    folder = path if path.is_dir() else path.parent
    file = folder / MATCH_JSON
    try:
        summary = MatchFile.model_validate_json(file.read_text("utf-8"))
        with np.load(folder / MATCH_NPZ, allow_pickle=False) as kept:
            arrays = dict(kept)
    except OSError as error:
        raise InputError(
            f"{error.filename or folder} cannot be read: run mbw match again"
        ) from error
    except (ValidationError, ValueError, BadZipFile) as error:
        raise InputError(f"{file} is not of this version: run mbw match again") from error
    return Result(summary, arrays)
