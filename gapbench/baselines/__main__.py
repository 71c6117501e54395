"""``python -m gapbench.baselines NAME FOLDER``: print a baseline's answer for a campaign."""

import json
import sys
from pathlib import Path

from gapbench.baselines.latent_force import latent_force
from gapbench.baselines.ranking import ranking, refit_only
from gapbench.baselines.refit import refit

BASELINES = {"refit_only": refit_only, "ranking": ranking, "latent_force": latent_force}


def main(arguments: list[str]) -> int:
    """Print the answer; return the exit code."""
    if len(arguments) != 2 or arguments[0] not in BASELINES:
        print(f"give one of {', '.join(BASELINES)} and a folder", file=sys.stderr)
        return 2
    name, folder = arguments
    print(json.dumps({"format": 1, **BASELINES[name](refit(Path(folder)))}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
