"""Paths in a copy of an MJCF that lies in another folder than its source."""

import os
from pathlib import Path
from xml.dom import minidom

from mbmodel.mjcf.expand import flatten_mjcf
from mbmodel.mjcf.source_files import read_source_files

# Attributes of <compiler> that name folders.
_FOLDER_ATTRIBUTES = ("assetdir", "meshdir", "texturedir")
_FILE_TAGS = ("mesh", "hfield", "skin", "texture", "flexcomp")


def redirect_paths(document: minidom.Document, source: Path, target: Path) -> None:
    """Change all folders and files that an MJCF names, so that it finds them from another folder.

    They become relative to the new folder, so that both folders can move together. On another
    drive they become absolute. ``meshdir`` and ``texturedir`` are written once, in the last
    ``<compiler>``, which counts.

    Args:
        document: the MJCF; changed in place.
        source: the MJCF that was read.
        target: folder in which the copy will lie.
    """
    places = target.resolve(), source.resolve().parent
    main, *included = [file.root for file in read_source_files(source) if file.model == source]
    roots = [main, *included]
    if any(next(root.iter(tag), None) is not None for root in roots for tag in _FILE_TAGS):
        folders = _asset_folders(flatten_mjcf(source))
        for compiler in document.getElementsByTagName("compiler"):
            for name in _FOLDER_ATTRIBUTES:
                if compiler.hasAttribute(name):
                    compiler.removeAttribute(name)
        stated = any(
            compiler.get(name)
            for root in included
            for compiler in root.iter("compiler")
            for name in _FOLDER_ATTRIBUTES
        )
        last = _last_compiler(document, behind_all=stated)
        for name, value in folders.items():
            last.setAttribute(name, _redirect(value, *places))
    for kind in ("include", "model"):
        for element in document.getElementsByTagName(kind):
            if name := element.getAttribute("file"):
                element.setAttribute("file", _redirect(name, *places))


def _asset_folders(document: minidom.Document) -> dict[str, str]:
    """Return meshdir and texturedir of an MJCF without includes, whose last <compiler> counts."""
    folders = {"meshdir": "", "texturedir": ""}
    for compiler in document.getElementsByTagName("compiler"):
        if shared := compiler.getAttribute("assetdir"):
            folders = dict.fromkeys(folders, shared)
        for name in folders:
            folders[name] = compiler.getAttribute(name) or folders[name]
    return folders


def _redirect(name: str, target: Path, source: Path) -> str:
    """Return a path that finds from a folder what a name finds from another one.

    It passes through no third folder, since that may be a temporary one.

    Args:
        name: of a file or folder, relative to the folder of the source, or absolute.
        source: folder of the source.
    """
    if Path(name).is_absolute():
        return Path(name).as_posix()
    end = os.path.normpath(source / name)
    try:
        return Path(os.path.relpath(end, target)).as_posix()
    except ValueError:  # on another drive
        return Path(end).as_posix()


def _last_compiler(document: minidom.Document, *, behind_all: bool) -> minidom.Element:
    """Return the <compiler> that counts, created if missing.

    Args:
        behind_all: whether included files have such elements, so that it must follow them.
    """
    compilers = document.getElementsByTagName("compiler")
    if compilers and not behind_all:
        return compilers[-1]
    compiler = document.createElement("compiler")
    if document.documentElement is not None:
        place = None if behind_all else document.documentElement.firstChild
        document.documentElement.insertBefore(compiler, place)
    return compiler
