"""Hash of what determines a verdict, so that no refit of other inputs is resumed."""

from diagnosis.effects import load_catalogue
from diagnosis.settings import SETTINGS
from tuning import Session, fingerprint


def hash_inputs(session: Session) -> str:
    """Return a hash of all that determines the verdict: inputs, effects and settings."""
    effects = {name: effect.means for name, effect in load_catalogue().items()}
    return fingerprint(session, {"effects": effects, "settings": SETTINGS})
