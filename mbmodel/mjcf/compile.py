"""Compilation of an MJCF with its meshes: those that give mass are checked and summed exactly."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Real
from mbmodel.meshes.files import is_ascii_stl, is_gmsh, read_mesh
from mbmodel.meshes.mass_properties import (
    mesh_mass_properties,
    surface_mass_properties,
    surface_triangles,
)
from mbmodel.meshes.surface import find_overlap, merge_points, point_text
from mbmodel.mjcf.source_files import read_source_files
from mbmodel.mjcf.urdf import settle_links, with_parents
from mbmodel.mujoco_start import mujoco_path

_MESH_INERTIA = mujoco.mjtMeshInertia
_INERTIA_FROM_GEOM = mujoco.mjtInertiaFromGeom
# Settings of a mesh whose mass is that of its volume.
_VOLUME_INERTIAS = (_MESH_INERTIA.mjMESH_INERTIA_LEGACY, _MESH_INERTIA.mjMESH_INERTIA_EXACT)
_MAX_SILENT_MASS_CHANGE = 1e-3  # of a body: less needs no remark
# Files that ``read_mesh`` reads.
_READABLE_SUFFIXES = (".stl", ".obj", ".msh", ".vtu")


SpecChange = Callable[[mujoco.MjSpec], None]  # adds elements to a specification, in place


def compile_with_meshes(
    path: Path, change: SpecChange | None = None
) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    """Compile an MJCF so that its meshes have the mass of the volume that they enclose.

    MuJoCo's default overestimates the volume of shapes that are not convex. Its exact sum accepts
    an open surface without a message, and it reads neither VTU nor gmsh nor ASCII STL. So meshes
    that give mass to a moving body are checked here and summed exactly, and files that MuJoCo
    cannot read are passed on as triangles. An ``inertia`` that the MJCF states is respected.
    Meshes for display only are not checked. MuJoCo keeps vertices in single precision, so masses
    are accurate to some 1e-7.

    Args:
        change: adds elements before the specification is compiled; None for none.

    Returns:
        The model, and remarks on bodies whose mass is another one in MuJoCo, and on shells that
        overlap.

    Raises:
        InputError: a mesh that gives mass encloses no definite volume, or cannot be read.
        ValueError: what MuJoCo refuses.
    """
    spec = mujoco.MjSpec.from_file(mujoco_path(path))
    spec.compiler.discardvisual = False  # the pictures show what it discards
    users = [geom for geom in spec.geoms if geom.meshname]
    with_mass = {geom.meshname for geom in users if _gives_mass(spec, geom)}
    remarks: list[str] = []
    if read_source_files(path)[0].root.tag == "robot":
        remarks += settle_links(spec, path, with_mass)
    as_primitive = {geom.meshname for geom in users if geom.type != mujoco.mjtGeom.mjGEOM_MESH}
    unchecked = []
    stated = _meshes_with_inertia(path)
    is_changed = False
    for mesh in spec.meshes:
        solid = mesh.name in with_mass and mesh.inertia in _VOLUME_INERTIAS
        if mesh.name in stated and mesh.inertia == _MESH_INERTIA.mjMESH_INERTIA_LEGACY:
            continue
        try:
            checked, overlap = _prepare_mesh(mesh, _file_of(spec, mesh, path), solid=solid)
        except InputError as error:
            raise InputError(f"{path}: mesh {mesh.name!r}: {error}") from error
        if overlap is not None:
            remarks.append(
                f"mesh {mesh.name!r}: two of its parts overlap near {point_text(overlap)}, and "
                "what they share counts twice in its mass: unite them"
            )
        if solid:
            is_changed |= mesh.inertia != _MESH_INERTIA.mjMESH_INERTIA_EXACT
            mesh.inertia = _MESH_INERTIA.mjMESH_INERTIA_EXACT
            unchecked += [] if checked else [mesh.name]
        elif (
            mesh.name not in with_mass | as_primitive
            and mesh.inertia == _MESH_INERTIA.mjMESH_INERTIA_LEGACY
        ):
            # A shell always has an inertia: shapes for display need not be closed.
            mesh.inertia = _MESH_INERTIA.mjMESH_INERTIA_SHELL
    if change is not None:
        change(spec)
    model = spec.compile()
    _check_compiled(path, model, unchecked)
    if is_changed and change is None:
        remarks += _other_masses(path, model)
    return model, tuple(remarks)


def _meshes_with_inertia(path: Path) -> set[str]:
    """Return the names of the meshes whose <mesh> element states how its inertia is computed."""
    elements = [e for file in read_source_files(path) for e in file.root.iter("mesh")]
    return {
        element.get("name") or Path(element.get("file", "")).stem
        for element in elements
        if element.get("inertia")
    }


def _other_masses(path: Path, model: mujoco.MjModel) -> list[str]:
    """Return a remark for each body to which MuJoCo alone gives another mass than its mesh has."""
    try:
        alone = mujoco.MjModel.from_xml_path(mujoco_path(path))
    except ValueError:
        return []  # it cannot read these files at all
    return [
        f"body {model.body(number).name!r} has {model.body_mass[number]:.4g} kg, the exact volume "
        f"of its meshes; MuJoCo's default gives {alone.body_mass[number]:.4g} kg: state "
        'inertia="exact" in its <mesh>, or <inertial> in the body'
        for number in range(min(model.nbody, alone.nbody))
        if abs(alone.body_mass[number] - model.body_mass[number])
        > _MAX_SILENT_MASS_CHANGE * model.body_mass[number]
    ]


def _gives_mass(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Return whether a mesh geom gives the mass of its volume to a body that can move."""
    compiler, body = spec.compiler, geom.parent
    low, high = compiler.inertiagrouprange
    has_mass = geom.density > 0 if np.isnan(geom.mass) else geom.mass > 0
    counts = compiler.inertiafromgeom == _INERTIA_FROM_GEOM.mjINERTIAFROMGEOM_TRUE or (
        compiler.inertiafromgeom == _INERTIA_FROM_GEOM.mjINERTIAFROMGEOM_AUTO
        and not body.explicitinertial
    )
    return bool(
        geom.type == mujoco.mjtGeom.mjGEOM_MESH
        and geom.typeinertia == mujoco.mjtGeomInertia.mjINERTIA_VOLUME
        and has_mass
        and counts
        and low <= geom.group <= high
        and any(ancestor.joints for ancestor in with_parents(body))
    )


def _file_of(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, path: Path) -> Path | None:
    """Return the file of a mesh where MuJoCo looks for it; None if MuJoCo must find or read it."""
    if not mesh.file or mesh.content_type or mesh.plugin.active:
        return None
    name = Path(mesh.file).name if spec.strippath else mesh.file
    file = path.parent / mesh.compiler.meshdir / name
    if not file.is_file() or file.suffix.lower() not in _READABLE_SUFFIXES:
        return None
    return None if file.suffix.lower() == ".msh" and not is_gmsh(file) else file


def _prepare_mesh(
    mesh: mujoco.MjsMesh, file: Path | None, *, solid: bool
) -> tuple[bool, Real | None]:
    """Check a mesh that gives mass, and pass on to MuJoCo a mesh that it cannot read.

    Args:
        mesh: of the specification; changed in place.
        file: its file, or None if MuJoCo reads it.
        solid: whether the mesh gives the mass of its volume.

    Returns:
        Whether the mesh was checked, and a point at which two of its parts overlap, if any.
    """
    if file is None:
        if not (solid and len(mesh.userface)):
            return False, None
        corners = np.array(mesh.userface, np.intp).reshape(-1, 3)
        points = np.array(mesh.uservert, float).reshape(-1, 3)
        surface_mass_properties(points, corners, 1.0)
        return True, find_overlap(*merge_points(points, corners))
    overlap = None
    suffix = file.suffix.lower()
    is_foreign = suffix in (".msh", ".vtu") or (suffix == ".stl" and is_ascii_stl(file))
    if solid or is_foreign:
        content = read_mesh(file)
        if solid:
            mesh_mass_properties(content, 1.0)
            if not len(content.tetrahedra):
                overlap = find_overlap(*merge_points(content.points, content.triangles))
        if is_foreign:
            triangles = surface_triangles(content)
            used, corners = np.unique(triangles, return_inverse=True)
            mesh.uservert = content.points[used].ravel()
            mesh.userface = corners.ravel()
            mesh.file = ""
    return solid, overlap


def _check_compiled(path: Path, model: mujoco.MjModel, names: list[str]) -> None:
    """Check the meshes that only MuJoCo could read, in its own copy of them."""
    for name in names:
        mesh = model.mesh(name)
        points = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        corners = model.mesh_face[mesh.faceadr[0] : mesh.faceadr[0] + mesh.facenum[0]]
        try:
            surface_mass_properties(points.astype(float), corners.astype(np.intp), 1.0)
        except InputError as error:
            raise InputError(f"{path}: mesh {name!r}: {error}") from error
