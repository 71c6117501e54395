"""Tuned values back into the MJCF, and what it lacks; every other word of it untouched."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from identification.words import InputError, node_of

Kind = Literal["spring", "joint", "site", "inertial", "hit"]
Values = Mapping[str, str | float | Sequence[float]]

_FOLDERS = ("assetdir", "meshdir", "texturedir")
_TAGS: dict[Kind, tuple[str, ...]] = {
    "spring": ("joint", "spatial", "fixed"),
    "joint": ("joint",),
    "site": ("site",),
    "inertial": ("body",),
    "hit": ("site",),
}
# An orientation can be written in five ways, of which one may stand.
_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_REPLACED: dict[Kind, tuple[str, ...]] = {
    "spring": (),
    "joint": (),
    "site": (*_ORIENTATIONS, "fromto"),
    "inertial": (*_ORIENTATIONS, "diaginertia"),
    "hit": (),
}
_REARRANGING = ("fusestatic", "inertiafromgeom", "settotalmass", "boundmass", "boundinertia")
_OWN_FRAMES = ("frame", "replicate")


@dataclass(frozen=True)
class Edit:
    """Numbers of one element of an MJCF.

    Args:
        kind: spring (stiffness and damping of a joint or tendon), joint, site, inertial; hit: a
            site where the accelerometer is drawn, so that the hammer stays if the sensor moves.
        name: of the element; of its body for an inertial; of the accelerometer for a hit.
        values: by attribute; of a hit, none.
    """

    kind: Kind
    name: str
    values: Mapping[str, float | Sequence[float]]


@dataclass(frozen=True)
class Element:
    """An element of an MJCF, with those inside it.

    Args:
        tag: such as ``site``.
        values: its attributes.
        children: inside.
    """

    tag: str
    values: Values
    children: tuple["Element", ...] = ()


@dataclass(frozen=True)
class Addition:
    """An element that an MJCF has not.

    Args:
        name: what it holds, for a message.
        parent: name of the body that it is put in; ``worldbody`` or ``tendon`` for the section.
        element: what is added, its children and all.
    """

    name: str
    parent: str
    element: Element


@dataclass(frozen=True)
class NotHeld:
    """What an MJCF cannot hold, or not where it stands.

    Args:
        name: of the parameter or element.
        reason: why.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        """Name and reason."""
        return f"{self.name} ({self.reason})"


def write_mjcf(
    source: Path, target: Path, changes: Sequence[Edit | Addition | NotHeld]
) -> tuple[NotHeld, ...]:
    """Write a copy of an MJCF with other numbers.

    Of a polynomial stiffness or damping the linear term changes. If the copy goes to another
    folder, the folders of its meshes, textures and included files become absolute.

    Args:
        source: the MJCF that was read.
        target: the new file; its folder exists.
        changes: what Parts want written; what they know not to be held is passed on.

    Returns:
        What the file does not hold, as joints without a name or in an included file.

    Raises:
        InputError: the source cannot be read any more.
    """
    try:
        document = minidom.parse(str(source))
    except (OSError, ExpatError) as error:
        raise InputError(f"{source} cannot be read again ({error}): restore it") from error
    not_held = [change for change in changes if isinstance(change, NotHeld)]
    edits = [change for change in changes if isinstance(change, Edit)]
    for name in dict.fromkeys(edit.name for edit in edits if edit.kind == "hit"):
        _add_hit(document, name)
    for edit in (one for one in edits if one.kind != "hit"):
        if (reason := _apply(document, edit)) is not None:
            not_held += [NotHeld(f"{edit.name}.{attribute}", reason) for attribute in edit.values]
    for more in (change for change in changes if isinstance(change, Addition)):
        if not _add(document, more):
            not_held.append(NotHeld(more.name, f"no body {more.parent} in the file itself"))
    if source.resolve().parent != target.resolve().parent:
        _make_folders_absolute(document, source.resolve().parent)
    target.write_text(document.toxml() + "\n", encoding="utf-8")
    return tuple(not_held)


def _add(document: minidom.Document, more: Addition) -> bool:
    """Put an element in its parent; a section is made if there is none."""
    parent = _section(document, more.parent) or _find(document, Edit("inertial", more.parent, {}))
    if parent is None:
        return False
    parent.appendChild(_made(document, more.element))
    return True


def _section(document: minidom.Document, name: str) -> minidom.Element | None:
    root = document.documentElement
    if name not in ("worldbody", "tendon") or root is None:
        return None
    sections = document.getElementsByTagName(name)
    return sections[0] if sections else root.appendChild(document.createElement(name))


def _made(document: minidom.Document, one: Element) -> minidom.Element:
    element = document.createElement(one.tag)
    for attribute, value in one.values.items():
        element.setAttribute(attribute, value if isinstance(value, str) else _numbers(value))
    for child in one.children:
        element.appendChild(_made(document, child))
    return element


def _numbers(value: float | Sequence[float]) -> str:
    numbers = [value] if isinstance(value, float) else list(value)
    return " ".join(f"{number:.17g}" for number in numbers)


def _add_hit(document: minidom.Document, name: str) -> None:
    """A copy of an accelerometer's site under the hammer's name, unless there is one."""
    hit = f"hit{node_of(name)}"
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
    """Write an edit, or say why it cannot be."""
    element = _find(document, edit)
    if element is None:
        return "no element of this name in the file itself"
    if edit.kind != "spring" and _inside(element, _OWN_FRAMES):
        return "it stands inside a <frame>"
    if edit.kind in ("inertial", "site") and (setting := _rearranged(document)):
        return f"the compiler has {setting}"
    if edit.kind == "inertial":
        element = _inertial(document, element)
    for attribute in _REPLACED[edit.kind]:
        if element.hasAttribute(attribute):
            element.removeAttribute(attribute)
    for attribute, value in edit.values.items():
        numbers = [value] if isinstance(value, float) else list(value)
        words = [f"{number:.17g}" for number in numbers]
        if edit.kind == "spring":
            words += element.getAttribute(attribute).split()[1:]
        element.setAttribute(attribute, " ".join(words))
    return None


def _find(document: minidom.Document, edit: Edit) -> minidom.Element | None:
    for section in ("worldbody", "tendon"):
        for parent in document.getElementsByTagName(section):
            for tag in _TAGS[edit.kind]:
                for element in parent.getElementsByTagName(tag):
                    if element.getAttribute("name") == edit.name:
                        return element
    return None


def _inside(element: minidom.Element, tags: Sequence[str]) -> bool:
    """Whether something between an element and its body has a frame of its own."""
    parent = element.parentNode
    if element.tagName == "body":
        return False
    while isinstance(parent, minidom.Element) and parent.tagName not in ("body", "worldbody"):
        if parent.tagName in tags:
            return True
        parent = parent.parentNode
    return False


def _rearranged(document: minidom.Document) -> str:
    """A setting by which MuJoCo makes other bodies and masses than the file states."""
    for compiler in document.getElementsByTagName("compiler"):
        for attribute in _REARRANGING:
            value = compiler.getAttribute(attribute)
            if value not in ("", "false", "auto") and not _is_off(value):
                return f'{attribute}="{value}"'
    return ""


def _is_off(value: str) -> bool:
    try:
        return float(value) <= 0
    except ValueError:
        return False


def _inertial(document: minidom.Document, body: minidom.Element) -> minidom.Element:
    """The body's own <inertial>, made if there is none: it then counts instead of the geoms."""
    for child in body.childNodes:
        if isinstance(child, minidom.Element) and child.tagName == "inertial":
            return child
    inertial = document.createElement("inertial")
    body.insertBefore(inertial, body.firstChild)
    return inertial


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
