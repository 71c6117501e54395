"""Ten virtual gondolas, matched as the paper prints it and with all that is known.

Each is a structure of its own (``assets/gondola/truths.npz``), struck six times; right is the mode
of the drawing that it is by the whole mesh; others are modes that the drawing does not have. Then
with few channels and without some of the shapes: how often what is stated so surely is right.
Structures 0 to 9; the others are for development.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from identification import read_layout
from identification.impacts import ImpactRecord, impact_record, impact_spectra, synchronise
from identification.matching import ModeMatch, match_by_ratios, match_modes, shapes_at_channels
from identification.shapes import Shapes, read_shapes, rigid_modes
from identification.words import ConvergenceError, Integers, Layout
from tests.helpers.virtual_gondola import Structure, Trial, read_structure, strike

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
SEEDS = range(10)
FIRST = 1000  # of trials
BAND = (15.0, 95.0)
SURE, SIX, NONE = 0.9, 6, -1
TURNS, BINS = 6, (0.0, 0.5, 0.7, 0.9, 0.99, 1.01)  # of few channels
NEAR = 0.02  # of a frequency: a measured mode is that of the structure


def run() -> list[dict[str, object]]:
    """Test, match and count."""
    drawn = read_shapes(ASSETS / "shapes.vtu")
    shapes = drawn.select(rigid_modes(drawn).supported)
    layout = read_layout(ASSETS / "layout.toml")
    rows, told = [], []
    for seed in SEEDS:
        structure = read_structure(ASSETS / "truths.npz", seed)
        records = tested(structure, Trial(FIRST + seed))
        rows.append({"structure": seed} | one(structure, records, shapes, layout))
        for turn in range(TURNS):
            told += few((seed, turn), structure, records, shapes, layout)
    return [*rows, *stated(told)]


def one(
    structure: Structure, records: list[ImpactRecord], shapes: Shapes, layout: Layout
) -> dict[str, object]:
    """One structure: pairs right of the first six modes, by either method."""
    begun = time.process_time()
    spectra = impact_spectra([synchronise(record) for record in records], BAND)
    found = match_modes(shapes, layout, spectra)
    seconds = time.process_time() - begun
    counts = dict.fromkeys(("right", "wrong", "wrong above 0.9", "others", "others left out"), 0)
    for mode, truth in truths(structure, found, np.arange(len(shapes))):
        simulated = found.pairs.get(mode, NONE)
        counts["right"] += 0 <= truth == simulated < SIX
        counts["wrong"] += simulated not in (NONE, truth)
        sure = simulated != NONE and found.probability[mode, simulated] > SURE
        counts["wrong above 0.9"] += bool(sure and simulated != truth)
        counts["others"] += truth == NONE
        counts["others left out"] += truth == simulated == NONE
    row: dict[str, object] = dict(counts)
    at = shapes_at_channels(shapes, layout, spectra.dofs)
    own = elastic(structure)
    for reading in ("largest", "reference"):
        printed = match_by_ratios(spectra, at, "acc2", reading=reading)  # type: ignore[arg-type]
        peaks = spectra.freq_hz[printed.peaks]
        near = [
            abs(peaks[mode] / frequency - 1) < NEAR for frequency, mode in own if 0 <= mode < SIX
        ]
        row[f"as printed, to the {reading}"] = int(sum(near))
    return row | {"core s": seconds}


def elastic(structure: Structure) -> list[tuple[float, int]]:
    """Frequency of each elastic mode and which of the drawing's it is."""
    pairs = zip(structure.frequencies.tolist(), structure.pairs.tolist(), strict=True)
    return [(f, pair - SIX if pair >= SIX else NONE) for f, pair in pairs if f > 1.0]


def truths(structure: Structure, found: ModeMatch, kept: Integers) -> Iterator[tuple[int, int]]:
    """Each measured mode that is one of the structure's, and its place among the kept shapes."""
    frequencies, pairs = map(np.array, zip(*elastic(structure), strict=True))
    for mode, frequency in enumerate(found.measured.frequencies.tolist()):
        off = np.abs(frequencies / frequency - 1)
        if off.min() < NEAR:
            place = np.flatnonzero(kept == pairs[off.argmin()])
            yield mode, int(place[0]) if len(place) else NONE


def few(
    seed: tuple[int, int],
    structure: Structure,
    records: list[ImpactRecord],
    shapes: Shapes,
    layout: Layout,
) -> list[tuple[str, float, bool]]:
    """What is stated with few channels, and shapes that are not there: of what, how surely, right.

    Args:
        seed: of what is drawn: three to eight channels, up to two shapes of the first eight gone.
        structure: that was struck.
        records: of two impacts that count, all channels.
        shapes: of the drawing.
        layout: of the channels.
    """
    random = np.random.default_rng([*seed, 170])
    names = [one.name for one in records[0].channels]
    chosen = random.choice(names, random.integers(3, 9), replace=False)
    gone = random.choice(8, random.integers(0, 3), replace=False)
    kept = np.setdiff1d(np.arange(len(shapes)), gone)
    hits = random.choice(len(records), 2, replace=False)
    some = [
        replace(
            records[k], channels=tuple(one for one in records[k].channels if one.name in chosen)
        )
        for k in hits
    ]
    try:
        spectra = impact_spectra([synchronise(record) for record in some], BAND)
        found = match_modes(shapes.select(kept), layout, spectra)
    except ConvergenceError:
        return []
    rows = []
    for mode, truth in truths(structure, found, kept):
        simulated = found.pairs.get(mode, NONE)
        kind = "no match" if simulated == NONE else "a pair"
        none = 1 - float(found.probability[mode].sum())
        sure = none if simulated == NONE else float(found.probability[mode, simulated])
        rows.append((kind, sure, truth == simulated))
    return rows


def stated(told: list[tuple[str, float, bool]]) -> list[dict[str, object]]:
    """How often what was stated so surely was right."""
    rows: list[dict[str, object]] = []
    for kind in ("a pair", "no match"):
        for low, high in pairwise(BINS):
            own = [row[1:] for row in told if row[0] == kind and low <= row[1] < high]
            if own:
                mean, share = np.mean(own, axis=0).tolist()
                rows.append({"stated": kind, "n": len(own), "mean": mean, "right": share})
    return rows


def tested(structure: Structure, trial: Trial) -> list[ImpactRecord]:
    """Records of all points that are struck."""
    points = [name for name in structure.places if not name.startswith("acc")]
    return [impact_record(point, strike(structure, trial, point)) for point in points]
