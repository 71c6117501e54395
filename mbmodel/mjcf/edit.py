"""Writing of tuned values and of additional elements into a copy of an MJCF file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal
from xml.dom import minidom

from identification.words import node_number
from mbmodel.mjcf.asset_paths import redirect_paths
from mbmodel.mjcf.expand import expand_mjcf, parse_xml
from mbmodel.mjcf.keyframes import extend_keyframes

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
# An element between a body and its parts that has a frame of its own, and one that copies them.
_FRAME_TAG, _COPYING_TAG = "frame", "replicate"
# Attributes by which tendons, actuators and sensors refer to a site.
_SITE_REFERENCES = ("site", "refsite", "cranksite", "slidersite", "sidesite", "objname", "refname")
_DRAWN_SUFFIX = "_drawn"  # of the copy of a moved site to which other elements keep referring


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
        parent: name of the body that gets it; ``worldbody``, ``tendon`` or ``custom`` for the
            section.
        element: the element with its children.
        beside: body with which a site, or a body of the world, goes where the machine rests
            elsewhere than in the nominal model; its parent if empty.
    """

    name: str
    parent: str
    element: Element
    beside: str = ""


class MjcfLack(StrEnum):
    """Reasons why an MJCF cannot hold a change: the closed list in docs/reference/mjcf.md."""

    SENSOR_GAIN = "an MJCF site has no gain"
    SENSOR_DELAY = "an MJCF site has no delay"
    CHANNEL = "an MJCF describes no gain or delay of a channel"
    FORCE_CHANNEL = "an MJCF describes no force channel"
    HIT = "an MJCF site has one pose, but each hammer direction needs its own"
    LOOP = "an MJCF has no element for its controller"
    FREQUENCY = "no element of an MJCF depends on frequency in this way"
    ROTOR = "draw the rotor as a body on a hinge and let it spin"
    SOME_TESTS = "it acts in some tests only"
    INERTIA = (
        "no body can have the fitted moments of inertia, so the nearest possible ones are written"
    )
    MASS = "the mass of its MJCF body would not be positive"
    OTHER_PACKAGE = "its effect gives no MJCF element"


@dataclass(frozen=True)
class NotInMjcf:
    """A change that no MJCF can hold.

    Args:
        name: of the parameter or element.
        reason: why it cannot be written.
    """

    name: str
    reason: MjcfLack

    def __str__(self) -> str:
        """Return name and reason."""
        return f"{self.name} ({self.reason})"


@dataclass(frozen=True)
class Refusal:
    """A change for which this file has no place, though an MJCF may have one.

    Args:
        name: of the element.
        reason: what the file lacks.
    """

    name: str
    reason: str


def write_mjcf(
    source: Path,
    target: Path,
    changes: Sequence[Edit | Addition],
    folder: Path | None = None,
    *,
    expanded: bool = False,
) -> tuple[Refusal, ...]:
    """Write a copy of an MJCF with other numbers and additional elements.

    Everything else in the file stays as it is. For a polynomial stiffness or damping the linear
    term changes. If the copy goes to another folder, the paths of its meshes, textures and included
    files become relative to that folder. A site that moves with its sensor leaves a copy where it
    is drawn, to which tendons, actuators and MuJoCo sensors keep referring.

    The copy may still differ from what was meant, where settings or classes of the file act on
    what is written. ``mbmodel.writing.write_model`` reads it back.

    Args:
        source: the MJCF that was read.
        target: the new file; its folder exists.
        changes: what Parts ask to be written.
        folder: folder to which the new file will move; None if it stays.
        expanded: whether to write the expanded MJCF, in which every element states its own values,
            in place of the file as its author wrote it.

    Returns:
        Changes for which the file has no place, such as those of joints without a name or in an
        included file. An expanded file holds all of them.

    Raises:
        InputError: the source cannot be read any more.
    """
    document = expand_mjcf(source) if expanded else parse_xml(source)
    refused = []
    edits = [change for change in changes if isinstance(change, Edit)]
    for name in dict.fromkeys(edit.name for edit in edits if edit.kind == "hit"):
        _add_hit(document, name)
    for edit in (edit for edit in edits if edit.kind != "hit"):
        if (reason := _apply(document, edit)) is not None:
            refused += [Refusal(f"{edit.name}.{attribute}", reason) for attribute in edit.values]
    added = []
    additions = [change for change in changes if isinstance(change, Addition)]
    for addition in sorted(additions, key=lambda addition: addition.parent == "tendon"):
        if (node := _add(document, addition)) is not None:
            added.append((addition.parent, node))
        else:
            refused.append(Refusal(addition.name, f"the file itself has no body {addition.parent}"))
    extend_keyframes(document, source, added)
    home = (folder or target.parent).resolve()
    if source.resolve().parent != home:
        redirect_paths(document, source, home)
    target.write_text(document.toxml() + "\n", encoding="utf-8")
    return tuple(refused)


def _add(document: minidom.Document, addition: Addition) -> minidom.Element | None:
    """Add an element to its parent and return it; None without parent; create missing sections."""
    parent = _section(document, addition.parent) or _find(
        document, Edit("inertial", addition.parent, {})
    )
    if parent is None:
        return None
    node = make_element(document, addition.element)
    for child in node.getElementsByTagName("joint") if node.tagName == "fixed" else ():
        # A direction without a joint is rigid, and adds nothing to the tendon's length.
        if _find(document, Edit("joint", child.getAttribute("joint"), {})) is None:
            node.removeChild(child)
    parent.appendChild(node)
    return node


def _section(document: minidom.Document, name: str) -> minidom.Element | None:
    """Return the section of a name, created if missing; None for a body."""
    root = document.documentElement
    if name not in ("worldbody", "tendon", "custom") or root is None:
        return None
    # A <default> may hold a <tendon>, too.
    sections = [each for each in document.getElementsByTagName(name) if each.parentNode is root]
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
    if edit.kind == "site":
        _keep_drawn_site(document, element)
    if edit.kind in ("joint", "site") and not _leave_frames(element):
        return "the element is inside a <replicate>"
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


def _leave_frames(element: minidom.Element) -> bool:
    """Move an element out of frames into its body, with their class; return False in a replicate.

    The values of edits are in the axes of the body.
    """
    outermost, parent, childclass = None, element.parentNode, ""
    while isinstance(parent, minidom.Element) and parent.tagName in (_FRAME_TAG, _COPYING_TAG):
        if parent.tagName == _COPYING_TAG:
            return False
        childclass = childclass or parent.getAttribute("childclass")
        outermost, parent = parent, parent.parentNode
    if outermost is not None and isinstance(parent, minidom.Element):
        parent.insertBefore(element, outermost)
        if childclass and not element.hasAttribute("class"):
            element.setAttribute("class", childclass)
    return True


def _keep_drawn_site(document: minidom.Document, site: minidom.Element) -> None:
    """Leave a copy of a site where it is drawn, if other elements refer to the site."""
    name, parent = site.getAttribute("name"), site.parentNode
    users = [
        (element, attribute)
        for section in ("tendon", "actuator", "sensor", "equality")
        for root in document.getElementsByTagName(section)
        for element in root.getElementsByTagName("*")
        for attribute in _SITE_REFERENCES
        if element.getAttribute(attribute) == name
        and (attribute in element.attributes)
        and not (attribute == "objname" and element.getAttribute("objtype") != "site")
        and not (attribute == "refname" and element.getAttribute("reftype") != "site")
    ]
    if not users or not isinstance(parent, minidom.Element):
        return
    copy = site.cloneNode(True)
    if copy is None:
        return
    copy.setAttribute("name", f"{name}{_DRAWN_SUFFIX}")
    parent.insertBefore(copy, site)
    for element, attribute in users:
        element.setAttribute(attribute, f"{name}{_DRAWN_SUFFIX}")


def _find(document: minidom.Document, edit: Edit) -> minidom.Element | None:
    """Return the element that an edit names, or None."""
    for section in ("worldbody", "tendon"):
        for parent in document.getElementsByTagName(section):
            for tag in _TAGS_OF_KIND[edit.kind]:
                for element in parent.getElementsByTagName(tag):
                    if element.getAttribute("name") == edit.name:
                        return element
    return None


def _inertial(document: minidom.Document, body: minidom.Element) -> minidom.Element:
    """Return the body's own <inertial>, created if missing; it then replaces the geoms' mass."""
    for child in body.childNodes:
        if isinstance(child, minidom.Element) and child.tagName == "inertial":
            return child
    inertial = document.createElement("inertial")
    body.insertBefore(inertial, body.firstChild)
    return inertial
