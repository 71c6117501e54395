"""Writing of tuned values and of additional elements into a copy of an MJCF file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from identification.words import InputError, node_number
from mbmodel.mjcf.asset_paths import redirect_paths
from mbmodel.mjcf.keyframe_edit import extend_keyframes

ElementKind = Literal["spring", "joint", "site", "inertial", "hit"]
Values = Mapping[str, str | float | Sequence[float]]

# Tags in which an element of each kind is searched.
_TAGS_OF_KIND: dict[ElementKind, tuple[str, ...]] = {
    "spring": ("joint", "spatial", "fixed"),
    "joint": ("joint",),
    "site": ("site",),
    "inertial": ("body",),
    "hit": ("site",),
}
# MJCF allows one of these five ways to write an orientation.
_ORIENTATION_ATTRIBUTES = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
# Attributes that would contradict the values written.
_REMOVED_ATTRIBUTES: dict[ElementKind, tuple[str, ...]] = {
    "spring": (),
    "joint": (),
    "site": (*_ORIENTATION_ATTRIBUTES, "fromto"),
    "inertial": (*_ORIENTATION_ATTRIBUTES, "diaginertia"),
    "hit": (),
}
# Settings of <compiler> by which MuJoCo changes bodies or masses after reading them.
_BODY_CHANGING_SETTINGS = (
    "fusestatic",
    "inertiafromgeom",
    "settotalmass",
    "boundmass",
    "boundinertia",
)
# Elements between a body and its parts that have a frame of their own.
_FRAME_TAGS = ("frame", "replicate")


@dataclass(frozen=True)
class Edit:
    """New numbers for one element of an MJCF.

    Args:
        kind: spring (stiffness and damping of a joint or tendon), joint, site, inertial; hit: a
            site where the accelerometer is drawn, so that the hammer point stays if the sensor
            moves.
        name: of the element; of its body for an inertial; of the accelerometer for a hit.
        values: numbers by attribute; empty for a hit.
    """

    kind: ElementKind
    name: str
    values: Mapping[str, float | Sequence[float]]


@dataclass(frozen=True)
class Element:
    """An XML element of an MJCF, with its children.

    Args:
        tag: such as ``site``.
        values: its attributes.
        children: elements inside it.
    """

    tag: str
    values: Values
    children: tuple["Element", ...] = ()


@dataclass(frozen=True)
class Addition:
    """An element to add to an MJCF.

    Args:
        name: what it stands for, for messages.
        parent: name of the body that gets it; ``worldbody`` or ``tendon`` for the section.
        element: the element with its children.
    """

    name: str
    parent: str
    element: Element


@dataclass(frozen=True)
class NotInMjcf:
    """A change that cannot be written into an MJCF, or not at this place of the file.

    Args:
        name: of the parameter or element.
        reason: why it cannot be written.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        """Return name and reason."""
        return f"{self.name} ({self.reason})"


def write_mjcf(
    source: Path,
    target: Path,
    changes: Sequence[Edit | Addition | NotInMjcf],
    folder: Path | None = None,
) -> tuple[NotInMjcf, ...]:
    """Write a copy of an MJCF with other numbers and additional elements.

    Everything else in the file stays as it is. For a polynomial stiffness or damping the linear
    term changes. If the copy goes to another folder, the paths of its meshes, textures and included
    files become relative to that folder.

    Args:
        source: the MJCF that was read.
        target: the new file; its folder exists.
        changes: what Parts ask to be written; their ``NotInMjcf`` are returned as they are.
        folder: folder to which the new file will move; None if it stays.

    Returns:
        Changes that the file does not hold, such as those of joints without a name or in an
        included file.

    Raises:
        InputError: the source cannot be read any more.
    """
    try:
        document = minidom.parse(str(source))
    except (OSError, ExpatError) as error:
        raise InputError(f"{source} cannot be read again ({error}): restore the file") from error
    not_written = [change for change in changes if isinstance(change, NotInMjcf)]
    edits = [change for change in changes if isinstance(change, Edit)]
    for name in dict.fromkeys(edit.name for edit in edits if edit.kind == "hit"):
        _add_hit(document, name)
    for edit in (edit for edit in edits if edit.kind != "hit"):
        if (reason := _apply(document, edit)) is not None:
            not_written += [
                NotInMjcf(f"{edit.name}.{attribute}", reason) for attribute in edit.values
            ]
    added = []
    for addition in (change for change in changes if isinstance(change, Addition)):
        if (node := _add(document, addition)) is not None:
            added.append((addition.parent, node))
        else:
            not_written.append(
                NotInMjcf(addition.name, f"the file itself has no body {addition.parent}")
            )
    extend_keyframes(document, source, added)
    home = (folder or target.parent).resolve()
    if source.resolve().parent != home:
        redirect_paths(document, source, home)
    target.write_text(document.toxml() + "\n", encoding="utf-8")
    return tuple(not_written)


def _add(document: minidom.Document, addition: Addition) -> minidom.Element | None:
    """Add an element to its parent and return it; None without parent; create missing sections."""
    parent = _section(document, addition.parent) or _find(
        document, Edit("inertial", addition.parent, {})
    )
    if parent is None:
        return None
    node = make_element(document, addition.element)
    parent.appendChild(node)
    return node


def _section(document: minidom.Document, name: str) -> minidom.Element | None:
    """Return the section ``worldbody`` or ``tendon``, created if missing; None for a body."""
    root = document.documentElement
    if name not in ("worldbody", "tendon") or root is None:
        return None
    sections = document.getElementsByTagName(name)
    return sections[0] if sections else root.appendChild(document.createElement(name))


def make_element(document: minidom.Document, element: Element) -> minidom.Element:
    """Return an XML node for an element and its children, numbers with all their digits."""
    node = document.createElement(element.tag)
    for attribute, value in element.values.items():
        node.setAttribute(attribute, value if isinstance(value, str) else _numbers(value))
    for child in element.children:
        node.appendChild(make_element(document, child))
    return node


def _numbers(value: float | Sequence[float]) -> str:
    """Return numbers as MJCF text with all their digits."""
    numbers = [value] if isinstance(value, float) else list(value)
    return " ".join(f"{number:.17g}" for number in numbers)


def _add_hit(document: minidom.Document, name: str) -> None:
    """Copy an accelerometer's site under the hammer point's name, unless there is such a site."""
    hit = f"hit{node_number(name)}"
    if _find(document, Edit("site", hit, {})) is not None:
        return
    element = _find(document, Edit("site", name, {}))
    parent = None if element is None else element.parentNode
    if element is not None and isinstance(parent, minidom.Element):
        copy = document.createElement("site")
        for attribute, value in element.attributes.items():
            copy.setAttribute(attribute, value)
        copy.setAttribute("name", hit)
        parent.insertBefore(copy, element)


def _apply(document: minidom.Document, edit: Edit) -> str | None:
    """Write an edit into the document, or return the reason why this is not possible."""
    element = _find(document, edit)
    if element is None:
        return "the file itself has no element of this name"
    if edit.kind != "spring" and _inside(element, _FRAME_TAGS):
        return "the element is inside a <frame> or <replicate>"
    if edit.kind in ("inertial", "site") and (setting := _body_changing_setting(document)):
        return f"<compiler> has {setting}, which changes bodies after reading"
    if edit.kind == "inertial":
        element = _inertial(document, element)
    for attribute in _REMOVED_ATTRIBUTES[edit.kind]:
        if element.hasAttribute(attribute):
            element.removeAttribute(attribute)
    for attribute, value in edit.values.items():
        numbers = [value] if isinstance(value, float) else list(value)
        words = [f"{number:.17g}" for number in numbers]
        if edit.kind == "spring":
            words += element.getAttribute(attribute).split()[len(words) :]
        element.setAttribute(attribute, " ".join(words))
    return None


def _find(document: minidom.Document, edit: Edit) -> minidom.Element | None:
    """Return the element that an edit names, or None."""
    for section in ("worldbody", "tendon"):
        for parent in document.getElementsByTagName(section):
            for tag in _TAGS_OF_KIND[edit.kind]:
                for element in parent.getElementsByTagName(tag):
                    if element.getAttribute("name") == edit.name:
                        return element
    return None


def _inside(element: minidom.Element, tags: Sequence[str]) -> bool:
    """Return whether an element between this one and its body has a frame of its own."""
    parent = element.parentNode
    if element.tagName == "body":
        return False
    while isinstance(parent, minidom.Element) and parent.tagName not in ("body", "worldbody"):
        if parent.tagName in tags:
            return True
        parent = parent.parentNode
    return False


def _body_changing_setting(document: minidom.Document) -> str:
    """Return a setting by which MuJoCo changes the bodies that the file states, or nothing."""
    for compiler in document.getElementsByTagName("compiler"):
        for attribute in _BODY_CHANGING_SETTINGS:
            value = compiler.getAttribute(attribute)
            if value not in ("", "false", "auto") and not _is_off(value):
                return f'{attribute}="{value}"'
    return ""


def _is_off(value: str) -> bool:
    """Return whether a setting is a number that switches it off."""
    try:
        return float(value) <= 0
    except ValueError:
        return False


def _inertial(document: minidom.Document, body: minidom.Element) -> minidom.Element:
    """Return the body's own <inertial>, created if missing; it then replaces the geoms' mass."""
    for child in body.childNodes:
        if isinstance(child, minidom.Element) and child.tagName == "inertial":
            return child
    inertial = document.createElement("inertial")
    body.insertBefore(inertial, body.firstChild)
    return inertial
