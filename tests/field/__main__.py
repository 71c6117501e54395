"""``make field``: runs every field case and prints a table of expected, got and right.

``python -m tests.field units modes/mains_hum`` runs cases below these folders alone. The exit
code is 1 if a case is wrong.
"""

import sys
from concurrent.futures import ThreadPoolExecutor

from rich.console import Console
from rich.table import Table

from tests.field.cases import Outcome, case_names, run_case

_PROCESSES = 2  # calls of the command at once


def main(chosen: list[str]) -> int:
    """Run the chosen cases, or all; return the exit code."""
    names = [n for n in case_names() if not chosen or any(n.startswith(c) for c in chosen)]
    with ThreadPoolExecutor(_PROCESSES) as pool:
        outcomes = list(pool.map(run_case, names))
    console = Console(width=None if sys.stdout.isatty() else 160, highlight=False, markup=False)
    console.print(_table(outcomes))
    n_right = sum(not outcome.faults for outcome in outcomes)
    console.print(f"{n_right} of {len(outcomes)} right")
    return 0 if n_right == len(outcomes) else 1


def _table(outcomes: list[Outcome]) -> Table:
    table = Table(show_lines=True)
    for heading in ("input", "situation", "expected", "got", "right"):
        table.add_column(heading, overflow="fold")
    for outcome in outcomes:
        got = "; ".join(outcome.faults) or outcome.got
        right = "no" if outcome.faults else "yes"
        table.add_row(outcome.name, outcome.case.situation, outcome.case.expected, got, right)
    return table


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
