"""Hash of what determines a verdict, so that no refit of other inputs is resumed."""

import hashlib
import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.effects import EFFECTS, load_catalogue
from diagnosis.effects.plugin_checks import list_start_values
from diagnosis.effects.plugins import CheckedProposal
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.settings import SETTINGS, DiagnosisSettings
from mbmodel import PartContext
from tuning import Session, fingerprint

_HASHED_SUFFIXES = (".py", ".json", ".toml")  # of code, and of constants beside it
_PLAIN_FIELDS = (
    "location", "dof", "release", "begin", "otherwise", "scored", "follow", "linear", "tie_share",
    "signed", "is_slope_informative", "bounds", "believed", "valid_below_bound", "is_modelled",
    "spring",
)  # fmt: skip  # fields of a hypothesis that hold no function


def hash_inputs(session: Session, settings: DiagnosisSettings = SETTINGS) -> str:
    """Return a hash of all that determines the verdict: inputs, effects and settings.

    An effect is known by the code of its package. One of another package is also known by what it
    proposes for the nominal model, since its numbers may come from elsewhere.

    Args:
        settings: thresholds and sizes of the search, as ``diagnose`` takes them.
    """
    effects = {name: _hash_code(effect) for name, effect in load_catalogue().items()}
    scene = Scene(session, session.model.drawn, settings=settings)
    proposals = {
        name: _hash_proposals(effect, scene)
        for name, effect in load_catalogue().items()
        if name not in EFFECTS
    }
    return fingerprint(session, {"effects": effects, "proposals": proposals, "settings": settings})


def _hash_code(effect: Effect) -> str:
    """Return the hash of the code that an effect comes from."""
    propose: Callable[..., Any] = effect.propose
    while isinstance(propose, CheckedProposal | partial):
        propose = propose.propose if isinstance(propose, CheckedProposal) else propose.func
    name = getattr(propose, "__module__", None) or type(propose).__module__
    top = sys.modules.get(name.partition(".")[0])
    file = getattr(top, "__file__", None)
    return "" if file is None else _hash_files(Path(file))


@cache
def _hash_files(file: Path) -> str:
    """Return the hash of a module, or of all files of a package."""
    folder = file.parent
    is_package = file.name == "__init__.py"
    files = sorted(path for path in folder.rglob("*") if path.suffix in _HASHED_SUFFIXES)
    digest = hashlib.sha256()
    for path in files if is_package else [file]:
        digest.update(f"{path.relative_to(folder)}\n".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _hash_proposals(effect: Effect, scene: Scene) -> str:
    """Return the hash of what an effect proposes: places, parameters and changes of the motion."""
    digest = hashlib.sha256()
    for hypothesis in effect(scene):
        plain = [repr(getattr(hypothesis, name)) for name in _PLAIN_FIELDS]
        digest.update("\n".join(plain).encode())
        for content in _changes(hypothesis, scene):
            digest.update(content)
    return digest.hexdigest()


def _changes(hypothesis: Hypothesis, scene: Scene) -> Iterator[bytes]:
    """Yield the parameters and changes of the Parts of a hypothesis as bytes."""
    starts, machine = list_start_values(hypothesis, scene), scene.model.machine
    laplace = np.asarray(2j * np.pi * scene.session.campaign.freq_hz[-1:], complex)
    for part in hypothesis.parts:
        yield repr(part.parameters).encode()
        # At their start most Parts change nothing.
        theta = np.array([starts[parameter.name] + 0.5 for parameter in part.parameters])
        for condition in {test.condition: None for test in scene.session.campaign.tests}:
            for change in part.changes(theta, PartContext(machine, condition)):
                yield f"{change.slot} {change.point}".encode()
                shape = np.ones(1) if change.shape is None else change.shape(laplace)
                for values in (change.left, change.core, change.right, shape):
                    yield np.asarray(values).tobytes()
