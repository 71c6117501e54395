"""URDF files as they are published: meshes by package, and links that cannot move.

MuJoCo looks for no packages, reads no COLLADA, and refuses an inertia that is none also of a link
that is fixed to the ground. Shapes of links that state their inertia are for the eye alone.
"""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError

_ROS_PACKAGE = "package://"
_URDF_MESH_SUFFIXES = (".stl", ".obj", ".msh", ".vtu")


def settle_links(spec: mujoco.MjSpec, path: Path, with_mass: set[str]) -> tuple[str, ...]:
    """Name the files of meshes as they lie here, and leave out what counts for nothing.

    Args:
        spec: of a URDF; changed in place.
        path: of the URDF. A package is a folder above it, or one in a folder above it.
        with_mass: names of meshes that give mass, which stay.

    Returns:
        A remark on meshes that are left out, if there are any.

    Raises:
        InputError: a mesh that gives mass cannot be read.
    """
    left_out = []
    for mesh in list(spec.meshes):
        if mesh.file.startswith(_ROS_PACKAGE):
            place = _find_in_package(mesh.file.removeprefix(_ROS_PACKAGE), path)
            mesh.file = str(place or mesh.file)
        name = Path(mesh.file).name if spec.strippath else mesh.file
        file = path.parent / spec.meshdir / name
        if file.is_file() and file.suffix.lower() in _URDF_MESH_SUFFIXES:
            continue
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        if mesh.name in with_mass:
            why = "is of a kind that MuJoCo does not read" if file.is_file() else "is missing"
            raise InputError(
                f"{path}: link {shapes[0].parent.name!r} has no <inertial>, and the mesh that "
                f"would give its mass {why} ({mesh.file}): add the <inertial>, or the mesh as .stl"
            )
        left_out.append(mesh.file)
        for geom in shapes:
            spec.delete(geom)
        spec.delete(mesh)
    for body in spec.bodies:
        if not any(above.joints for above in with_parents(body)):
            body.explicitinertial = False
            body.fullinertia = np.full(6, np.nan)
    if not left_out:
        return ()
    return (
        f"meshes that are missing, or of a kind that MuJoCo does not read, are left out of the "
        f"pictures: {len(left_out)}, the first of them {left_out[0]}; <inertial> gives the masses",
    )


def with_parents(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    """Yield a body and its ancestors below the world."""
    while body.name != "world":
        yield body
        body = body.parent


def _find_in_package(name: str, path: Path) -> Path | None:
    """Return a file of a package, by the package's name and the file's path in it."""
    package, _, inside = name.partition("/")
    for folder in path.absolute().parents:
        for file in (folder / package / inside, folder / inside):
            if file.is_file():
                return file
    return None
