"""``python -m tests.language PACKAGE ...``: what these packages break of the language's rules."""

import sys

from tests.language.rules import (
    PACKAGES,
    check_exports,
    check_package,
    check_together,
    parse_package,
)


def main(chosen: list[str]) -> int:
    """Print every violation in the chosen packages, exceptions included."""
    together = check_together({k: v for name in PACKAGES for k, v in parse_package(name).items()})
    for package in chosen or PACKAGES:
        for violation in (*check_package(package), *check_exports(package)):
            print(violation)
        for violation in together:
            if violation.path.startswith(f"{package}/"):
                print(violation)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
