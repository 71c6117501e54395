"""Make the gondola of three frames: ``make gondola-frames``, which needs CalculiX.

``shapes_three_frames.vtu`` holds the modes of the drawing with its inner frames on pins, on the
nodes of the outer frame, normalised by the mass of all three. ``truths_three_frames.npz`` holds
structures of three frames that differ from it, at the places of ``layout.toml``: frequencies,
shapes, and which mode each is of the single frame and of the three frames, by the whole mesh.
"""

import sys
from pathlib import Path

import numpy as np
from make_gondola import write
from panels import Build, panels_of
from pinned_frames import INNER, MIDDLE, PIN_STIFFNESS, RigidFrame, deck, springs
from places import sensors, struck
from solver import Modes, modes_of
from truths import alike, build, pairs_by

HERE = Path(__file__).resolve().parent
COUNT = 26  # modes: up to 1.3 times the band that was measured
SEEDS = range(5)


def main() -> None:
    """Solve the drawing of three frames and the structures that differ from it."""
    single_panels = panels_of(Build())
    single = modes_of(single_panels, 1.0, 20)
    frames = (MIDDLE, INNER)
    joined = modes_of(single_panels, 1.0, COUNT, deck(single_panels, frames, springs(frames)))
    write(HERE / "shapes_three_frames.vtu", single_panels, joined)
    places = [*sensors(single_panels, single), *struck(single_panels)]
    kept: dict[str, np.ndarray] = {
        "places": np.array([place.name for place in places]),
        "axes": np.array([place.axes for place in places]),
    }
    for seed in SEEDS:
        structure, mass = tested(seed)
        kept[f"frequencies_{seed}"] = structure.frequencies
        kept[f"shapes_{seed}"] = structure.shapes[:, [place.node for place in places]].astype(
            np.float32
        )
        kept[f"single_{seed}"] = pairs_by(alike(single_panels, single, structure))
        kept[f"pairs_{seed}"] = pairs_by(alike(single_panels, joined, structure))
        kept[f"mass_{seed}"] = np.array(mass)
        sys.stdout.write(f"{seed}: {mass:.1f} kg, {np.round(structure.frequencies[6:], 2)} Hz\n")
    np.savez_compressed(HERE / "truths_three_frames.npz", **kept)
    rows = "  ".join(f"{f:.2f}" for f in joined.frequencies[6:])
    sys.stdout.write(f"{single_panels.mass + MIDDLE.mass + INNER.mass:.1f} kg; {rows} Hz\n")


def tested(seed: int) -> tuple[Modes, float]:
    """A structure of three frames that differs from the drawing, and its mass [kg]."""
    random = np.random.default_rng([seed, 20150919])
    structure = build(seed, 0)
    panels = panels_of(structure)
    frames = tuple(
        RigidFrame(frame.mass * random.uniform(0.95, 1.05), frame.half) for frame in (MIDDLE, INNER)
    )
    joints = springs(frames, PIN_STIFFNESS * random.uniform(0.7, 1.4))
    modes = modes_of(panels, structure.bending, COUNT + 4, deck(panels, frames, joints))
    return modes, panels.mass + sum(frame.mass for frame in frames)


if __name__ == "__main__":
    main()
