"""Make the gondola's shapes: ``make gondola``, which needs CalculiX (Debian: ``calculix-ccx``).

``shapes.vtu`` holds the modes of the drawing, free in space, normalised by mass: what a
finite-element model knows; shapes are rounded to six digits. ``layout.toml`` says where sensors sit
and where it is struck, ``truths.npz`` what other structures do there that are tested instead of it.
"""

import sys
from pathlib import Path

import meshio
import numpy as np
from joblib import Parallel, delayed
from panels import Build, Panels, panels_of
from places import layout, sensors, struck
from solver import Modes, modes_of
from truths import truth

HERE = Path(__file__).resolve().parent
COUNT = 20  # modes, the six rigid ones among them: up to twice the band that was measured
SEEDS = *range(12), 15, 16  # 10, 11, 15 are for development, 16 is the demonstration's
_DIGITS = 6


def main() -> None:
    """Solve the drawing and write its shapes."""
    build = Build()
    panels = panels_of(build)
    modes = modes_of(panels, build.bending, COUNT)
    write(HERE / "shapes.vtu", panels, modes)
    places = [*sensors(panels, modes), *struck(panels)]
    (HERE / "layout.toml").write_text(layout(places), encoding="utf-8")
    kept = {"places": np.array([place.name for place in places])}
    kept["axes"] = np.array([place.axes for place in places])
    drawn = Parallel(n_jobs=-1, return_as="generator")(
        delayed(truth)(seed, panels, modes, places) for seed in SEEDS
    )
    for seed, one in zip(SEEDS, drawn, strict=True):
        kept |= {f"{name}_{seed}": value for name, value in one.items()}
        own = [int(np.flatnonzero(one["pairs"] == mode)[0]) for mode in range(6, 12)]
        off = modes.frequencies[6:12] / one["frequencies"][own] - 1
        sys.stdout.write(f"{seed}: {float(one['mass']):.1f} kg, off by {np.round(off, 3)}, ")
        sys.stdout.write(f"modes {one['pairs'][6:16]}\n")
        sys.stdout.flush()
    np.savez_compressed(HERE / "truths.npz", **kept)
    rows = "  ".join(f"{f:.2f}" for f in modes.frequencies[6:])
    sys.stdout.write(f"{panels.mass:.1f} kg; {rows} Hz\n")


def write(path: Path, panels: Panels, modes: Modes) -> None:
    """Write modes as point data, the frequency in each one's name."""
    data = {
        f"mode {number} ({frequency:.4f} Hz)": rounded(shape).astype(np.float32)
        for number, (frequency, shape) in enumerate(
            zip(modes.frequencies, modes.shapes, strict=True), start=1
        )
    }
    mesh = meshio.Mesh(panels.points, [("quad8", panels.elements)], point_data=data)
    mesh.write(path, file_format="vtu", binary=True, compression="zlib")


def rounded(shape: np.ndarray) -> np.ndarray:
    """To so many digits of the largest, its sign by its largest value."""
    largest = np.abs(shape).max()
    signed = shape * np.sign(shape.ravel()[np.abs(shape).argmax()])
    step = 10.0 ** (np.floor(np.log10(largest)) - _DIGITS + 1)
    return np.round(signed / step) * step


if __name__ == "__main__":
    main()
