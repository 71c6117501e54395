"""Make the station's meshes and write what they weigh into its MJCF: ``make station``.

The free dimensions of each stage are solved for, rounded to micrometres as on a drawing, and the
mesh is written; mass, centre and inertia are then read back from the mesh. ``station_legs.xml`` is
derived from ``station.xml``, so that both stay in step.
"""

import re
from pathlib import Path

import numpy as np
from legs import write_legs
from numpy.typing import NDArray
from scipy.optimize import least_squares
from shapes import Shell, together
from stages import TARGETS, Target

from mbmodel.meshes.mass_properties import (
    MassProperties,
    read_mass_properties,
    surface_mass_properties,
)

HERE = Path(__file__).resolve().parent
MESHES = HERE / "meshes"
STATION = HERE / "station.xml"
MICROMETRE = 1e-6
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def main() -> None:
    """Write the meshes, then both machines."""
    MESHES.mkdir(exist_ok=True)
    text = STATION.read_text(encoding="utf-8")
    for name, target in TARGETS.items():
        file = MESHES / f"{name}.stl"
        file.write_bytes(stl_bytes(together(target.shells(*dimensions(target))), name))
        text = with_inertial(text, name, read_mass_properties(file, target.density))
    STATION.write_text(text, encoding="utf-8")
    write_legs(text, HERE / "station_legs.xml")


def dimensions(target: Target) -> NDArray[np.float64]:
    """The free dimensions that give a stage its mass and its centre of mass [m]."""
    wanted = np.array([target.centre[axis] for axis in target.axes])

    def missing(free: NDArray[np.float64]) -> NDArray[np.float64]:
        solid = surface_mass_properties(*together(target.shells(*free)), target.density)
        return np.r_[solid.mass / target.mass - 1, solid.centre[list(target.axes)] - wanted]

    first = np.array(list(target.free.values()))
    found = least_squares(missing, first, x_scale=0.01, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    if np.abs(found.fun).max() > MICROMETRE:
        raise RuntimeError(f"no dimensions found, {found.fun} remains: change the fixed ones")
    rounded: NDArray[np.float64] = np.round(found.x / MICROMETRE) * MICROMETRE
    return rounded


def stl_bytes(shell: Shell, name: str) -> bytes:
    """A binary STL file; coordinates rounded to micrometres, so that every computer agrees."""
    points, triangles = shell
    corners = (np.round(points / MICROMETRE) * MICROMETRE)[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(
        len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("", "<u2")]
    )
    facets["normal"] = np.round(normals, 6) + 0.0
    facets["corners"] = corners + 0.0
    head = f"{name}, metres, world axes".encode().ljust(80)
    return head + np.uint32(len(triangles)).astype("<u4").tobytes() + facets.tobytes()


def with_inertial(text: str, body: str, solid: MassProperties) -> str:
    """The MJCF with another <inertial> in a body, which must have one."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = solid.inertia
    place = " ".join(f"{round(value, 9) + 0.0:.9g}" for value in solid.centre)
    full = " ".join(f"{round(value, 9) + 0.0:.9g}" for value in (xx, yy, zz, xy, xz, yz))
    new = f'<inertial pos="{place}" mass="{solid.mass:.9g}" fullinertia="{full}"/>'
    pattern = rf'(<body name="{body}">\s*)<inertial [^>]*/>'
    changed, count = re.subn(pattern, lambda found: found[1] + new, text)
    if count != 1:
        raise RuntimeError(f"{STATION} has {count} bodies {body!r} with <inertial>: mend it")
    return changed


if __name__ == "__main__":
    main()
