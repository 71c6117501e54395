"""Tuned values back into the MJCF, every other word of it untouched."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from identification.words import InputError


def write_mjcf(source: Path, target: Path, values: Mapping[str, float]) -> tuple[str, ...]:
    """Write a copy of an MJCF with other joint and tendon coefficients.

    Args:
        source: the MJCF that was read.
        target: the new file; its folder exists. Paths of meshes are kept valid.
        values: ``{'<joint or tendon>.<stiffness or damping>': value}`` in SI.

    Returns:
        The names that the file cannot hold, as of joints without a name or in an included file.

    Raises:
        InputError: the source cannot be read any more.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    try:
        root = ElementTree.parse(source, parser).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"{source} cannot be read again ({error}): restore it") from error
    elements = {
        element.get("name"): element
        for kind in ("joint", "spatial", "fixed")
        for element in root.iter(kind)
    }
    not_held = []
    for name, value in values.items():
        element_name, attribute = name.rsplit(".", 1)
        element = elements.get(element_name)
        if element is None:
            not_held.append(name)
        else:
            element.set(attribute, f"{value:.17g}")
    _keep_meshes_valid(root, source, target)
    text = ElementTree.tostring(root, encoding="unicode")
    target.write_text(text + "\n", encoding="utf-8")
    return tuple(not_held)


def _keep_meshes_valid(root: ElementTree.Element, source: Path, target: Path) -> None:
    """Relative file names are relative to the MJCF: make them absolute when it moves."""
    if source.resolve().parent == target.resolve().parent:
        return
    folder = source.resolve().parent
    compiler = root.find("compiler")
    for attribute in ("meshdir", "texturedir", "assetdir"):
        if compiler is not None and compiler.get(attribute) is not None:
            compiler.set(attribute, str(folder / compiler.get(attribute, "")))
    stated = compiler is not None and any(
        compiler.get(name) is not None for name in ("meshdir", "assetdir")
    )
    for kind in ("mesh", "hfield", "skin", "texture", "include"):
        for element in root.iter(kind):
            if element.get("file") and (kind == "include" or not stated):
                element.set("file", str(folder / element.get("file", "")))
