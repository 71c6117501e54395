"""Meshes of an MJCF: those that give mass are checked and summed exactly, and all can be read."""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError
from mbmodel.meshes.files import is_ascii_stl, is_gmsh, read_mesh
from mbmodel.meshes.mass_properties import mesh_solid, surface_solid, surface_triangles

_INERTIA = mujoco.mjtMeshInertia
_FROM_GEOMS = mujoco.mjtInertiaFromGeom
_BY_VOLUME = (_INERTIA.mjMESH_INERTIA_LEGACY, _INERTIA.mjMESH_INERTIA_EXACT)
_READ_HERE = (".stl", ".obj", ".msh", ".vtu")


def compile_with_meshes(path: Path) -> mujoco.MjModel:
    """Compile an MJCF whose meshes weigh what they enclose.

    MuJoCo's default overcounts the volume of shapes that are not convex; its exact sum takes an
    open surface without a word, and it reads neither VTU nor gmsh nor STL in text. So meshes that
    give mass to a body that can move are checked here and summed exactly, and files that MuJoCo
    cannot read are handed over as triangles. ``inertia="convex"`` or ``"shell"`` in the MJCF is
    the author's word and stays. Meshes for the eye only are not checked. MuJoCo keeps vertices in
    single precision: masses are right to some 1e-7.

    Raises:
        InputError: a mesh that gives mass encloses no definite volume, or cannot be read.
        ValueError: what MuJoCo refuses.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    if not spec.meshes:
        return mujoco.MjModel.from_xml_path(str(path))
    users = [geom for geom in spec.geoms if geom.meshname]
    weighty = {geom.meshname for geom in users if _weighs(spec, geom)}
    fitted = {geom.meshname for geom in users if geom.type != mujoco.mjtGeom.mjGEOM_MESH}
    unseen = []
    for mesh in spec.meshes:
        solid = mesh.name in weighty and mesh.inertia in _BY_VOLUME
        try:
            seen = _take(mesh, _file_of(spec, mesh, path), solid=solid)
        except InputError as error:
            raise InputError(f"{path}: mesh {mesh.name!r}: {error}") from error
        if solid:
            mesh.inertia = _INERTIA.mjMESH_INERTIA_EXACT
            unseen += [] if seen else [mesh.name]
        elif mesh.name not in weighty | fitted and mesh.inertia == _INERTIA.mjMESH_INERTIA_LEGACY:
            # A surface always has one: shapes for the eye need not be closed.
            mesh.inertia = _INERTIA.mjMESH_INERTIA_SHELL
    model = spec.compile()
    _check_compiled(path, model, unseen)
    return model


def mesh_files(path: Path) -> tuple[Path, ...]:
    """Files of the meshes that an MJCF names, where they are files of their own."""
    spec = mujoco.MjSpec.from_file(str(path))
    named = ((mesh, Path(mesh.file).name if spec.strippath else mesh.file) for mesh in spec.meshes)
    files = {path.parent / mesh.compiler.meshdir / name for mesh, name in named if name}
    return tuple(sorted(file for file in files if file.is_file()))


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether a mesh geom gives the mass of its volume to a body that can move."""
    compiler, body = spec.compiler, geom.parent
    low, high = compiler.inertiagrouprange
    given = geom.density > 0 if np.isnan(geom.mass) else geom.mass > 0
    counts = compiler.inertiafromgeom == _FROM_GEOMS.mjINERTIAFROMGEOM_TRUE or (
        compiler.inertiafromgeom == _FROM_GEOMS.mjINERTIAFROMGEOM_AUTO and not body.explicitinertial
    )
    return bool(
        geom.type == mujoco.mjtGeom.mjGEOM_MESH
        and geom.typeinertia == mujoco.mjtGeomInertia.mjINERTIA_VOLUME
        and given
        and counts
        and low <= geom.group <= high
        and any(above.joints for above in _with_parents(body))
    )


def _with_parents(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    while body.name != "world":
        yield body
        body = body.parent


def _file_of(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, path: Path) -> Path | None:
    """The file of a mesh where MuJoCo looks for it; None if MuJoCo has to find or read it."""
    if not mesh.file or mesh.content_type or mesh.plugin.active:
        return None
    name = Path(mesh.file).name if spec.strippath else mesh.file
    file = path.parent / mesh.compiler.meshdir / name
    if not file.is_file() or file.suffix.lower() not in _READ_HERE:
        return None
    return None if file.suffix.lower() == ".msh" and not is_gmsh(file) else file


def _take(mesh: mujoco.MjsMesh, file: Path | None, *, solid: bool) -> bool:
    """Check a mesh that weighs, hand one over that MuJoCo cannot read; whether it was checked."""
    if file is None:
        if not (solid and len(mesh.userface)):
            return False
        corners = np.array(mesh.userface, np.intp).reshape(-1, 3)
        surface_solid(np.array(mesh.uservert, float).reshape(-1, 3), corners, 1.0)
        return True
    suffix = file.suffix.lower()
    foreign = suffix in (".msh", ".vtu") or (suffix == ".stl" and is_ascii_stl(file))
    if solid or foreign:
        content = read_mesh(file)
        if solid:
            mesh_solid(content, 1.0)
        if foreign:
            triangles = surface_triangles(content)
            used, corners = np.unique(triangles, return_inverse=True)
            mesh.uservert = content.points[used].ravel()
            mesh.userface = corners.ravel()
            mesh.file = ""
    return solid


def _check_compiled(path: Path, model: mujoco.MjModel, names: list[str]) -> None:
    """Check meshes that only MuJoCo could read, in its own copy of them."""
    for name in names:
        mesh = model.mesh(name)
        points = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        corners = model.mesh_face[mesh.faceadr[0] : mesh.faceadr[0] + mesh.facenum[0]]
        try:
            surface_solid(points.astype(float), corners.astype(np.intp), 1.0)
        except InputError as error:
            raise InputError(f"{path}: mesh {name!r}: {error}") from error
