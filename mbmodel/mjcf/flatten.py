"""One XML document of an MJCF and the files that it includes."""

from pathlib import Path
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from identification.words import InputError


def flatten_mjcf(source: Path) -> minidom.Document:
    """Return an MJCF with the content of its included files in place of their ``<include>``.

    MuJoCo looks for included files from the folder of the main file, and pastes what stands inside
    their top-level element.

    Args:
        source: the main file, which ``read_source_files`` has accepted.

    Raises:
        InputError: a file cannot be read any more.
    """
    document = parse_xml(source)
    while includes := document.getElementsByTagName("include"):
        for include in includes:
            parent = include.parentNode
            if not isinstance(parent, minidom.Element):
                raise InputError(f"{source}: its first element is <include>: write <mujoco>")
            content = root_element(parse_xml(source.parent / include.getAttribute("file")))
            for child in tuple(content.childNodes):
                parent.insertBefore(document.importNode(child, True), include)
            parent.removeChild(include)
    return document


def root_element(document: minidom.Document) -> minidom.Element:
    """Return the top-level element of a document."""
    if document.documentElement is None:
        raise ValueError("an XML document has no top-level element")
    return document.documentElement


def parse_xml(path: Path) -> minidom.Document:
    """Return the XML document of a file, which has been read before.

    Args:
        path: of the file.

    Raises:
        InputError: it cannot be read any more.
    """
    try:
        return minidom.parse(str(path))
    except (OSError, ExpatError) as error:
        raise InputError(f"{path} cannot be read again ({error}): restore the file") from error
