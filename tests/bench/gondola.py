"""Ten virtual gondolas, matched as the paper prints it and with all that is known.

Each is a structure of its own (``assets/gondola/truths.npz``), struck six times; right is the mode
of the drawing that it is by the whole mesh. Structures 0 to 9; 10 and 11 are for development.
"""

import time
from pathlib import Path

import numpy as np

from identification import read_layout
from identification.impacts import ImpactRecord, impact_record, impact_spectra, struck
from identification.matching import at_channels, match, printed_match
from identification.shapes import Shapes, read_shapes, rigid_modes
from identification.words import Layout
from truth.gondola import Structure, Trial, read_structure, strike

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
SEEDS = range(10)
FIRST = 1000  # of trials
BAND = (15.0, 95.0)
SURE = 0.9
NEAR = 0.02  # of a frequency: a measured mode is that of the structure


def run() -> list[dict[str, object]]:
    """Test, match and count."""
    drawn = read_shapes(ASSETS / "shapes.vtu")
    shapes = drawn.only(~rigid_modes(drawn).modes)
    layout = read_layout(ASSETS / "layout.toml")
    return [one(seed, shapes, layout) for seed in SEEDS]


def one(seed: int, shapes: Shapes, layout: Layout) -> dict[str, object]:
    """One structure: pairs right of the first six modes, by either method."""
    structure = read_structure(ASSETS / "truths.npz", seed)
    records = tested(structure, Trial(FIRST + seed))
    begun = time.process_time()
    spectra = impact_spectra([struck(record) for record in records], BAND)
    found = match(shapes, layout, spectra)
    seconds = time.process_time() - begun
    elastic = structure.frequencies > 1.0
    truth_hz, truth = structure.frequencies[elastic], structure.pairs[elastic] - 6
    right = wrong = sure = 0
    for mode, simulated in found.pairs.items():
        near = int(np.abs(truth_hz / found.measured.frequencies[mode] - 1).argmin())
        is_right = abs(truth_hz[near] / found.measured.frequencies[mode] - 1) < NEAR
        is_right &= bool(truth[near] == simulated)
        right += is_right and simulated < 6
        wrong += not is_right
        sure += not is_right and found.probability[mode, simulated] > SURE
    row: dict[str, object] = {
        "structure": seed,
        "right": right,
        "wrong": wrong,
        "wrong above 0.9": sure,
    }
    at = at_channels(shapes, layout, spectra.dofs)
    for reading in ("largest", "reference"):
        printed = printed_match(spectra, at, "acc2", reading=reading)  # type: ignore[arg-type]
        peaks = spectra.freq_hz[printed.peaks]
        own = [
            abs(peaks[mode] / truth_hz[truth == mode][0] - 1) < NEAR
            for mode in range(6)
            if (truth == mode).any()
        ]
        row[f"as printed, to the {reading}"] = int(sum(own))
    return row | {"core s": seconds}


def tested(structure: Structure, trial: Trial) -> list[ImpactRecord]:
    """Records of all points that are struck."""
    points = [name for name in structure.places if not name.startswith("acc")]
    return [impact_record(point, strike(structure, trial, point)) for point in points]
