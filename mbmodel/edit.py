"""Tuned values back into the MJCF, every other word of it untouched."""

from collections.abc import Mapping
from pathlib import Path
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from identification.words import InputError

_FOLDERS = ("assetdir", "meshdir", "texturedir")


def write_mjcf(source: Path, target: Path, values: Mapping[str, float]) -> tuple[str, ...]:
    """Write a copy of an MJCF with other joint and tendon coefficients.

    Of a polynomial stiffness or damping the linear term changes. If the copy goes to another
    folder, the folders of its meshes, textures and included files become absolute.

    Args:
        source: the MJCF that was read.
        target: the new file; its folder exists.
        values: ``{'<joint or tendon>.<stiffness or damping>': value}`` in SI.

    Returns:
        The names that the file cannot hold, as of joints without a name or in an included file.

    Raises:
        InputError: the source cannot be read any more.
    """
    try:
        document = minidom.parse(str(source))
    except (OSError, ExpatError) as error:
        raise InputError(f"{source} cannot be read again ({error}): restore it") from error
    elements = {
        element.getAttribute("name"): element
        for body in ("worldbody", "tendon")
        for parent in document.getElementsByTagName(body)
        for kind in ("joint", "spatial", "fixed")
        for element in parent.getElementsByTagName(kind)
        if element.hasAttribute("name")
    }
    not_held = []
    for name, value in values.items():
        element_name, attribute = name.rsplit(".", 1)
        element = elements.get(element_name)
        if element is None:
            not_held.append(name)
        else:
            higher = element.getAttribute(attribute).split()[1:]
            element.setAttribute(attribute, " ".join([f"{value:.17g}", *higher]))
    if source.resolve().parent != target.resolve().parent:
        _make_folders_absolute(document, source.resolve().parent)
    target.write_text(document.toxml() + "\n", encoding="utf-8")
    return tuple(not_held)


def _make_folders_absolute(document: minidom.Document, folder: Path) -> None:
    """State meshdir and texturedir once, absolute; the last of several compilers counts."""
    compilers = document.getElementsByTagName("compiler")
    found = {"meshdir": "", "texturedir": ""}
    for compiler in compilers:
        if compiler.hasAttribute("assetdir"):
            found = dict.fromkeys(found, compiler.getAttribute("assetdir"))
        for name in found:
            found[name] = compiler.getAttribute(name) or found[name]
        for name in _FOLDERS:
            if compiler.hasAttribute(name):
                compiler.removeAttribute(name)
    files = ("mesh", "hfield", "skin", "texture")
    if any(document.getElementsByTagName(kind) for kind in files):
        last = compilers[-1] if compilers else _new_compiler(document)
        for name, value in found.items():
            last.setAttribute(name, str(folder / value))
    _make_files_absolute(document, folder)


def _make_files_absolute(document: minidom.Document, folder: Path) -> None:
    for kind in ("include", "model"):
        for element in document.getElementsByTagName(kind):
            if element.getAttribute("file"):
                element.setAttribute("file", str(folder / element.getAttribute("file")))


def _new_compiler(document: minidom.Document) -> minidom.Element:
    compiler = document.createElement("compiler")
    if document.documentElement is not None:
        document.documentElement.insertBefore(compiler, document.documentElement.firstChild)
    return compiler
