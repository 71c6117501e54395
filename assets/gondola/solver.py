"""Modes of a mesh of shells by CalculiX (Debian: ``calculix-ccx``), free in space."""

import re
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from equivalent_shell import MODULUS, POISSON
from panels import Frame, Panels, Real

_CLASSES = 6  # digits of thickness and density that tell sections apart


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of a structure, shapes normalised by its mass.

    Args:
        frequencies: (n_mode,) [Hz].
        shapes: (n_mode, n_node, 3) [kg^-1/2].
    """

    frequencies: Real
    shapes: Real


def modes_of(panels: Panels, bending: float, count: int, attached: Sequence[str] = ()) -> Modes:
    """So many of the lowest modes, the six rigid ones among them; shapes of the panels alone.

    Args:
        panels: the mesh.
        bending: factor of the modulus.
        count: of modes.
        attached: lines of the deck with what hangs on the panels, such as of ``hung``.

    Raises:
        RuntimeError: CalculiX gave none.
    """
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "gondola"
        job.with_suffix(".inp").write_text(
            _deck(panels, bending, count, attached), encoding="ascii"
        )
        done = subprocess.run(
            ["ccx", "-i", job.name],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if not job.with_suffix(".frd").is_file() or done.returncode:
            raise RuntimeError(f"ccx failed: {done.stdout[-2000:]}")
        frequencies = _frequencies(job.with_suffix(".dat").read_text("ascii"))
        shapes = _shapes(job.with_suffix(".frd").read_text("ascii"), len(panels.points))
    return Modes(frequencies[:count], shapes[:count])


def _deck(panels: Panels, bending: float, count: int, attached: Sequence[str]) -> str:
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for k, (x, y, z) in enumerate(panels.points)]
    kinds: dict[tuple[float, float], list[int]] = {}
    for k, kind in enumerate(zip(panels.thickness, panels.density, strict=True)):
        key = (round(float(kind[0]), _CLASSES), round(float(kind[1]), _CLASSES - 3))
        kinds.setdefault(key, []).append(k)
    for number, own in enumerate(kinds.values()):
        lines.append(f"*ELEMENT, TYPE=S8R, ELSET=E{number}")
        for k in own:
            lines.append(", ".join(str(one) for one in (k + 1, *(panels.elements[k] + 1))))
    for number, (thickness, density) in enumerate(kinds):
        lines += [f"*MATERIAL, NAME=M{number}", "*ELASTIC", f"{bending * MODULUS:.9g}, {POISSON}"]
        lines += ["*DENSITY", f"{density:.9g}"]
        lines += [f"*SHELL SECTION, ELSET=E{number}, MATERIAL=M{number}", f"{thickness:.9g}"]
    lines += attached
    lines += ["*STEP", "*FREQUENCY", str(count), "*NODE FILE, OUTPUT=2D", "U", "*END STEP", ""]
    return "\n".join(lines)


def hung(panels: Panels, frames: tuple[Frame, ...]) -> list[str]:
    """A node with a mass for each frame, and springs from it to its pins."""
    lines, node, element = [], len(panels.points), len(panels.elements)
    for frame in frames:
        node, element = node + 1, element + 1
        own = f"F{node}"
        middle = np.mean(frame.pins, axis=0)
        lines += ["*NODE", f"{node}, " + ", ".join(f"{x:.9g}" for x in middle)]
        lines += [f"*ELEMENT, TYPE=MASS, ELSET={own}", f"{element}, {node}"]
        lines += [f"*MASS, ELSET={own}", f"{frame.mass:.9g}"]
        for pin in frame.pins:
            near = int(np.linalg.norm(panels.points - pin, axis=1).argmin()) + 1
            for axis, frequency in enumerate(frame.frequencies, start=1):
                element += 1
                stiffness = frame.mass * (2 * np.pi * frequency) ** 2 / len(frame.pins)
                lines += [f"*ELEMENT, TYPE=SPRING2, ELSET=S{element}", f"{element}, {node}, {near}"]
                lines += [f"*SPRING, ELSET=S{element}", f"{axis}, {axis}", f"{stiffness:.9g}"]
    return lines


def _frequencies(text: str) -> Real:
    """The second of the two columns of frequencies [Hz]; rigid modes may come out imaginary."""
    table = text.partition("E I G E N V A L U E   O U T P U T")[2]
    table = table.partition("P A R T I C I P A T I O N")[0]
    rows = re.findall(r"^ +\d+ +(\S+) +(\S+) +(\S+) +(\S+) *$", table, re.MULTILINE)
    return np.array([float(row[2]) for row in rows])


def _shapes(text: str, count: int) -> Real:
    """Displacements of every step, nodes in their order."""
    found = []
    for block in text.split(" -4  DISP")[1:]:
        shape = np.zeros((count, 3))
        for line in block.splitlines()[1:]:
            if line.startswith(" -3"):
                break
            if line.startswith(" -1"):
                number = int(line[3:13]) - 1
                if number < count:  # the others are frames
                    shape[number] = [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(3)]
        found.append(shape)
    return np.array(found)
