"""Draw the committed impact campaign: ``make gondola-campaign``.

A structure of its own (number 16 of ``truths.npz``, which no bench reports) is struck at two places
of the bow and two of the stern. 21 accelerometer channels at 15 places read it on clocks of their
own, about 1260 samples a second. The force is not measured, and nobody is told the structure:
``answer.toml`` holds what is true, and ``mbw demo gondola`` reads it last.

Records are short, since the slowest mode has decayed by a factor of 10 000 after three seconds. A
stamp counts ticks of 2^-18 s, a value steps of 2^-9 m/s2, as 16 bits of +-64 m/s2 have them: such
numbers compress, and four impacts stay below 2 MB.
"""

import csv
import io
import tomllib
from pathlib import Path

import numpy as np

from tests.helpers.virtual_gondola import (
    BAND,
    Structure,
    Trial,
    damping_of,
    read_structure,
    write_impacts,
)

HERE = Path(__file__).resolve().parent
FOLDER = HERE / "campaign"
STRUCTURE = 16
TRIAL = Trial(20_150_918, seconds=4.0, quiet=0.5, tick=2.0**-18, step=2.0**-9)
POINTS = ("bow1", "bow3", "stern1", "stern3")
RIGID = 6  # modes before the first elastic one of the drawing, whose numbers begin at 1


def main() -> None:
    """Write sites, records, campaign.toml and answer.toml."""
    structure = read_structure(HERE / "truths.npz", STRUCTURE)
    FOLDER.mkdir(exist_ok=True)
    sites = FOLDER / "sites.csv"
    sites.write_text(sites_table(structure), encoding="utf-8")
    write_impacts(FOLDER, structure, TRIAL, POINTS, sites, np.float32)
    with np.load(HERE / "truths.npz") as kept:
        mass = float(kept[f"mass_{STRUCTURE}"])
    (FOLDER / "answer.toml").write_text(answer(structure, mass), encoding="utf-8")


def sites_table(structure: Structure) -> str:
    """The sensors as a table of sites with the axes that are read."""
    places = tomllib.loads((HERE / "layout.toml").read_text("utf-8"))["site"]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("site", "x", "y", "z", "axes"))
    for name, axes in zip(structure.places, structure.axes, strict=True):
        if name.startswith("acc"):
            table.writerow((name, *(f"{x:.6g}" for x in places[name]["position"]), axes))
    return text.getvalue()


def answer(structure: Structure, mass: float) -> str:
    """The mass, and frequency, damping and simulated mode of every mode in the band."""
    lines = ["# The structure behind the records; no step of the match reads this.", ""]
    lines.append(f"mass = {mass:.2f}  # kg")
    modes = zip(structure.frequencies, damping_of(structure, TRIAL), structure.pairs, strict=True)
    for frequency, damping, pair in modes:
        if BAND[0] < frequency < BAND[1]:
            lines += ["", "[[mode]]", f"frequency = {frequency:.4f}  # Hz"]
            lines.append(f"damping = {damping:.5f}")
            if pair >= RIGID:
                lines.append(f"simulated = {pair + 1}")
            else:
                lines.append("# an inner frame's: none of the drawing's modes")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
