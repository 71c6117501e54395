"""Three frames on pins beside the outer frame alone: what the coupling of frames changes.

First the modes of the drawing: each mode of the single frame, and the mode of three frames that is
most similar on the outer frame. Then five structures of three frames, which differ from the
drawing, are struck and matched with the shapes of either model. Right is the mode of that model
that it is by the whole mesh (MAC above 0.5), or none.
"""

import numpy as np

from identification import read_layout
from identification.impacts import impact_spectra, synchronise
from identification.matching import match_modes
from identification.shapes import Shapes, read_shapes, rigid_modes
from identification.words import Layout
from tests.bench.gondola import ASSETS, BAND, NONE, SIX, tested, truths
from tests.helpers.virtual_gondola import Trial, read_structure

TRUTHS = ASSETS / "truths_three_frames.npz"
MODELS = {
    "single frame": ("shapes.vtu", "single"),
    "three frames": ("shapes_three_frames.vtu", "pairs"),
}
SEEDS, FIRST = range(5), 3000  # structures, and the first of their trials


def run() -> list[dict[str, object]]:
    """Compare the modes of both models, then match with either."""
    drawn = {name: read_shapes(ASSETS / file) for name, (file, _) in MODELS.items()}
    layout = read_layout(ASSETS / "layout.toml")
    rows = mode_rows(*drawn.values())
    for name, (_, key) in MODELS.items():
        shapes = drawn[name].select(rigid_modes(drawn[name]).supported)
        rows += [match_row(seed, name, key, shapes, layout) for seed in SEEDS]
    return rows


def mode_rows(single: Shapes, joined: Shapes) -> list[dict[str, object]]:
    """Elastic modes of the single frame in the band, each with the most similar joined mode."""
    first, second = (shapes.vectors.reshape(len(shapes), -1) for shapes in (single, joined))
    sizes = np.outer((first**2).sum(axis=1), (second**2).sum(axis=1))
    mac = (first @ second.T) ** 2 / sizes
    rows: list[dict[str, object]] = []
    for mode in range(SIX, len(single)):
        if single.frequencies[mode] < BAND[1]:
            partner = int(np.argmax(mac[mode, SIX:])) + SIX
            rows.append(
                {
                    "mode": mode + 1,
                    "single Hz": float(single.frequencies[mode]),
                    "three": partner + 1,
                    "three Hz": float(joined.frequencies[partner]),
                    "MAC": float(mac[mode, partner]),
                }
            )
    return rows


def match_row(seed: int, name: str, key: str, shapes: Shapes, layout: Layout) -> dict[str, object]:
    """Match one structure with the shapes of one model."""
    structure = read_structure(TRUTHS, seed, key)
    records = tested(structure, Trial(FIRST + seed))
    spectra = impact_spectra([synchronise(record) for record in records], BAND)
    found = match_modes(shapes, layout, spectra)
    counts = dict.fromkeys(("measured", "paired", "right", "wrong", "wrong above 0.9"), 0)
    macs, off = [], []
    for mode, truth in truths(structure, found, np.arange(len(shapes))):
        pair = found.pairs.get(mode, NONE)
        counts["measured"] += 1
        counts["paired"] += pair != NONE
        counts["right"] += NONE != pair == truth
        counts["wrong"] += pair not in (NONE, truth)
        counts["wrong above 0.9"] += bool(
            pair not in (NONE, truth) and found.probability[mode, pair] > 0.9
        )
        if pair != NONE:
            macs.append(float(found.mac[mode, pair]))
            off.append(abs(shapes.frequencies[pair] / found.measured.frequencies[mode] - 1))
    return (
        {"structure": seed, "model": name}
        | counts
        | {
            "median MAC": float(np.median(macs)),
            "median off %": 100 * float(np.median(off)),
        }
    )
