"""MJCF as one file: with its included files in it, or expanded as a compiler would change it.

MuJoCo writes a compiled specification so that each element states its own values: included and
attached files, replicas and classes of defaults are resolved, bodies state their inertia, joints
their stiffness where ``springdamper`` stood, actuators their damping where ``dampratio`` stood, and
settings such as ``settotalmass`` are gone. A URDF becomes an MJCF.
"""

import ctypes
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.dom import minidom
from xml.parsers.expat import ExpatError

import mujoco
import numpy as np

from identification.words import InputError
from mbmodel.mjcf.names import actuator_name, body_name, joint_name, tendon_name
from mbmodel.mjcf.read import compile_with_remarks

_ALL_DIGITS = 17  # of a double; MuJoCo writes six unless it is told otherwise
# Settings by which MuJoCo changes bodies after reading them; an expanded file states the outcome.
_BODY_CHANGING_SETTINGS = (
    "fusestatic",
    "inertiafromgeom",
    "settotalmass",
    "boundmass",
    "boundinertia",
    "balanceinertia",
)


def expand_mjcf(source: Path) -> minidom.Document:
    """Return the expanded MJCF of a file, in which every element that a label can mean has a name.

    Args:
        source: the MJCF or URDF.

    Raises:
        InputError: the file cannot be read any more.
    """
    specs: list[mujoco.MjSpec] = []
    compiled, _ = compile_with_remarks(source, without_friction=True, change=specs.append)
    (spec,) = specs
    for elements, name_of in (
        (spec.bodies, body_name),
        (spec.joints, joint_name),
        (spec.tendons, tendon_name),
        (spec.actuators, actuator_name),
    ):
        for element in elements:
            element.name = element.name or name_of(compiled, element.id)
    with _all_digits(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # reading the source has made them remarks
        document = minidom.parseString(spec.to_xml())
    for compiler in document.getElementsByTagName("compiler"):
        for attribute in _BODY_CHANGING_SETTINGS:
            if compiler.hasAttribute(attribute):
                compiler.removeAttribute(attribute)
    _state_inertia(document, compiled)
    return document


def _state_inertia(document: minidom.Document, compiled: mujoco.MjModel) -> None:
    """Give every body with mass its compiled <inertial>, in place of what geoms would give it."""
    elements = {body.getAttribute("name"): body for body in document.getElementsByTagName("body")}
    for number in np.flatnonzero(compiled.body_mass > 0).tolist():
        body = elements[body_name(compiled, number)]
        for child in tuple(body.childNodes):
            if isinstance(child, minidom.Element) and child.tagName == "inertial":
                body.removeChild(child)
        inertial = document.createElement("inertial")
        for attribute, values in (
            ("pos", compiled.body_ipos[number]),
            ("quat", compiled.body_iquat[number]),
            ("mass", compiled.body_mass[number : number + 1]),
            ("diaginertia", compiled.body_inertia[number]),
        ):
            text = " ".join(f"{value:.{_ALL_DIGITS}g}" for value in values.tolist())
            inertial.setAttribute(attribute, text)
        body.insertBefore(inertial, body.firstChild)


@contextmanager
def _all_digits() -> Iterator[None]:
    """Let MuJoCo write numbers with all their digits.

    MuJoCo's C interface has a function for it that Python does not offer. Without it numbers have
    six digits, which reading the written file back would find.
    """
    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
    getter = getattr(library, "_mjPRIVATE__get_xml_precision", lambda: None)
    setter = getattr(library, "_mjPRIVATE__set_xml_precision", lambda _: None)
    before = getter()
    setter(_ALL_DIGITS)
    try:
        yield
    finally:
        setter(before)


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

    Raises:
        InputError: it cannot be read any more.
    """
    try:
        return minidom.parse(str(path))
    except (OSError, ExpatError) as error:
        raise InputError(f"{path} cannot be read again ({error}): restore the file") from error
