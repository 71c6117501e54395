"""Copy of a stage's MJCF that can be attached to a body of another machine."""

from dataclasses import dataclass
from pathlib import Path
from xml.dom import minidom

from identification.words import InputError
from mbmodel.mjcf.expand import expand_mjcf, flatten_mjcf, root_element

# Sections in which the machine's own settings count; keyframes are those of both together.
_MACHINE_SECTIONS = ("option", "visual", "statistic", "size", "keyframe")
# What stands still in the stage's world and belongs to its surroundings.
_SURROUNDINGS = ("geom", "light")
# Elements of the world that group others.
_GROUPING_TAGS = ("frame", "replicate")


@dataclass(frozen=True, eq=False)
class StageCopy:
    """A stage without its surroundings.

    Args:
        document: the copy.
        has_geoms: whether the world of the stage has geoms; the copy has none of them.
    """

    document: minidom.Document
    has_geoms: bool


def copy_stage(source: Path, *, expanded: bool = False) -> StageCopy:
    """Return what of a stage's MJCF is mounted: its bodies, and the sites of its world.

    The world of the stage becomes the body that carries it. Springs may begin at sites of that
    world, so these stay. Its geoms would give the carrying body mass, and are left out.

    Args:
        source: MJCF of the stage.
        expanded: whether to copy its expanded form.

    Raises:
        InputError: the file is no MJCF, or has no body.
    """
    document = (expand_mjcf if expanded else flatten_mjcf)(source)
    root = root_element(document)
    if root.tagName != "mujoco":
        raise InputError(f"{source} is no MJCF: its first element must be <mujoco>")
    if not document.getElementsByTagName("body"):
        raise InputError(f"{source} has no body to mount: write the stage as bodies")
    for child in tuple(root.childNodes):
        if isinstance(child, minidom.Element) and child.tagName in _MACHINE_SECTIONS:
            root.removeChild(child)
    worlds = document.getElementsByTagName("worldbody")
    removed = [tag for world in worlds for tag in _remove_surroundings(world)]
    return StageCopy(document, "geom" in removed)


def _remove_surroundings(parent: minidom.Element) -> list[str]:
    """Remove geoms and lights that stand in the world itself; return their tags."""
    removed = []
    for child in tuple(parent.childNodes):
        if not isinstance(child, minidom.Element):
            continue
        if child.tagName in _SURROUNDINGS:
            parent.removeChild(child)
            removed.append(child.tagName)
        elif child.tagName in _GROUPING_TAGS:
            removed += _remove_surroundings(child)
    return removed
