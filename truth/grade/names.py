"""The names that verdicts and answers share: effects, where they sit, and locations.

The table is that of the contract of the files, written down once more on this side: a judge must
not take what is right from those whom it judges.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from truth.errors import TruthError

KINDS = ("joint", "body", "sensor", "hammer", "pair")
NONE, UNEXPLAINED, SEVERAL = "none", "unexplained", "several"


@dataclass(frozen=True)
class Entry:
    """What an effect of the catalogue is.

    Args:
        kind: of its place.
        size: the parameter that tells how strong it is; empty if none does.
        neutral: value of that parameter at which there is no effect.
    """

    kind: str
    size: str = ""
    neutral: float = 0.0


CATALOGUE: Mapping[str, Entry] = MappingProxyType(
    {
        "mass_error": Entry("body", "mass"),
        "appendage": Entry("body", "mass"),
        "flexible_body": Entry("body"),
        "gyroscopic": Entry("body", "angular_momentum"),
        "joint_coupling": Entry("joint", "offset"),
        "missing_dof": Entry("joint", "stiffness"),
        "structural_damping": Entry("joint", "loss_factor"),
        "viscoelastic": Entry("joint", "ratio"),
        "inertance": Entry("joint", "inertance"),
        "stiffness": Entry("joint", "factor", 1.0),
        "damping": Entry("joint", "factor", 1.0),
        "feedback_delay": Entry("joint", "delay"),
        "support_loss": Entry("joint", "fraction", 1.0),
        "friction": Entry("joint", "k"),
        "backlash": Entry("joint", "gap"),
        "hardening": Entry("joint", "k3"),
        "parallel_path": Entry("pair", "stiffness"),
        "sensor_gain": Entry("sensor", "gain", 1.0),
        "sensor_polarity": Entry("sensor"),
        "sensor_misalignment": Entry("sensor", "rotation"),
        "sensor_position": Entry("sensor", "offset"),
        "sensor_swap": Entry("sensor"),
        "sensor_delay": Entry("sensor", "delay"),
        "mount_resonance": Entry("sensor", "frequency"),
        "hammer_misalignment": Entry("hammer", "rotation"),
        "drift": Entry("joint", "factor", 1.0),
        "hammer_gain": Entry("hammer", "gain", 1.0),
        "hammer_delay": Entry("hammer", "delay"),
        "hammer_position": Entry("hammer", "offset"),
    }
)

STATED = ("stiffness", "damping")  # need a state before, or a stated prior


def kind_of(location: str) -> str:
    """Return the kind of a location, ``joint`` of ``joint:ty``; empty of an empty one."""
    return location.partition(":")[0]


def canonical(location: str) -> str:
    """Return a location such that two names of one place become the same.

    ``sensor:a+b`` is ``sensor:b+a``, and a pair likewise. A body's name may have hyphens, so a
    pair is brought to the first, by alphabet, of all its turns at a hyphen.

    Raises:
        TruthError: the location is none.
    """
    kind, _, name = location.partition(":")
    if kind not in KINDS or not name:
        raise TruthError(f"location {location!r}: expected <kind>:<name>, {', '.join(KINDS)}")
    if kind == "sensor":
        sites = name.split("+")
        if "" in sites or len(set(sites)) < len(sites) or len(sites) > 2:
            raise TruthError(f"location {location!r}: expected one sensor, or two different ones")
        return f"sensor:{'+'.join(sorted(sites))}"
    if kind == "pair":
        parts = name.split("-")
        if len(parts) < 2 or "" in (parts[0], parts[-1]):
            raise TruthError(f"location {location!r}: expected pair:<lower body>-<upper body>")
        return "pair:" + min("-".join(parts[i:] + parts[:i]) for i in range(len(parts)))
    return location


def check_place(effect: str, location: str) -> str:
    """Return the canonical location of an effect of the catalogue.

    Raises:
        TruthError: the effect is unknown, or cannot sit there.
    """
    if effect not in CATALOGUE:
        raise TruthError(f"effect {effect!r} is not in the catalogue")
    place = canonical(location)
    if kind_of(place) != CATALOGUE[effect].kind:
        raise TruthError(f"{effect} at {location!r}: it sits at {CATALOGUE[effect].kind}:<name>")
    if "+" in place and kind_of(place) == "sensor" and effect != "sensor_swap":
        raise TruthError(f"{effect} at {location!r}: it sits at one sensor")
    return place


def direction(dof: str) -> str:
    """Return a direction such that ``tx+ty`` and ``ty+tx`` are the same; others stay."""
    known = dof.split("+")
    if all(len(part) == 2 and part[0] in "tr" and part[1] in "xyz" for part in known):
        return "+".join(sorted(known))
    return dof
