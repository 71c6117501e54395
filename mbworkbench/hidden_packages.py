"""Files of a user that hide a package: Python looks in the folder of a script first."""

from importlib.util import find_spec
from pathlib import Path

_PACKAGES = ("identification", "mbmodel", "tuning", "diagnosis")


def refuse_hidden_packages() -> None:
    """Raise ImportError, in a sentence, where another file has the name of a package.

    Raises:
        ImportError: Python would import a file that is no package of the workbench.
    """
    home = Path(__file__).resolve().parents[1]
    for name in _PACKAGES:
        spec = find_spec(name)
        origin = None if spec is None else spec.origin
        if origin is not None and Path(origin).resolve().parents[1] != home:
            raise ImportError(
                f"{origin} hides the package {name} of mbworkbench: rename that file, or start "
                "Python in another folder"
            )
