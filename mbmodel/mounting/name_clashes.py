"""Names of a machine and a stage: a prefix for the stage where they clash."""

import re
from xml.dom import minidom

import mujoco

Names = frozenset[tuple[str, str]]  # kind of element, name

# MuJoCo's arrays of addresses of names, by kind, whose elements labels and ports name: a site of
# the stage must not share a name with a body of the machine.
_PORT_KINDS = ("body", "jnt", "site", "actuator", "tendon", "sensor")
_WORLD_NAME = "world"  # of body 0 in every model
_UNPLAIN_CHARACTERS = re.compile(r"[:/\s]+")  # labels use the colon, MuJoCo the slash


def choose_prefix(machine: Names, stage: Names, name: str) -> str:
    """Return a prefix by which no name of a stage is one of the machine; empty if none clashes.

    Args:
        machine: names of the machine.
        stage: names of the stage.
        name: of the stage as a whole; the prefix begins with it.
    """
    plain = _UNPLAIN_CHARACTERS.sub("_", name)
    candidates = ("", f"{plain}_", *(f"{plain}{number}_" for number in range(2, len(machine) + 3)))
    return next(
        prefix
        for prefix in candidates
        if not machine & {(kind, prefix + element) for kind, element in stage}
    )


def find_names(model: mujoco.MjModel, document: minidom.Document) -> Names:
    """Return the names of all elements and classes of an MJCF; ports count as one kind.

    Names of keyframes do not count: those of machine and stage are joined.

    Args:
        model: the MJCF compiled.
        document: the MJCF as text.
    """
    names = set()
    for attribute in dir(model):
        if match := re.fullmatch(r"name_(\w+)adr", attribute):
            if match[1] == "key":
                continue
            kind = "port" if match[1] in _PORT_KINDS else match[1]
            for address in getattr(model, attribute):
                text = model.names[address : model.names.index(b"\0", address)].decode()
                if text not in ("", _WORLD_NAME):
                    names.add((kind, text))
    for default in document.getElementsByTagName("default"):
        if text := default.getAttribute("class"):
            names.add(("class", text))
    return frozenset(names)


def free_name(taken: Names, stem: str) -> str:
    """Return the first of ``stem1``, ``stem2`` ... that no element bears."""
    texts = {text for _, text in taken}
    numbers = range(1, len(texts) + 2)
    return next(f"{stem}{number}" for number in numbers if f"{stem}{number}" not in texts)
