"""The command ``gapbench``: run an entry on a set, grade and compare answers, draw sets."""

import argparse
import json
import math
import sys
from pathlib import Path

from gapbench.run import DEFAULT_SECONDS, STRATA, RunError, open_set, run_entry
from gapbench.seed import seed_of
from gapbench.table import grade_file, markdown

BUNDLED = Path(__file__).parent / "bundled.zip"
BAD_INPUT, INTERRUPTED = 3, 130
# Seeds of sets that are no set of anybody's own, with what they are.
TAKEN_SEEDS = {
    930000: "the bundled set, by which entries are compared: take another to develop on",
    940000: "the set on which the baselines were tuned: take another to compare with them",
}


def _positive(text: str) -> float:
    """Return a number above zero."""
    number = float(text)
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: give a number above 0")
    return number


def _count(text: str) -> int:
    """Return a whole number above zero."""
    if not (text.isdigit() and int(text)):
        raise argparse.ArgumentTypeError(f"{text}: give a whole number above 0")
    return int(text)


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gapbench", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    run = verbs.add_parser("run", help="run a command on every campaign of a set")
    run.add_argument("--out", type=Path, default=Path("answers.jsonl"), help="answers, one a line")
    run.add_argument(
        "--seconds",
        type=_positive,
        default=DEFAULT_SECONDS,
        help=f"core seconds of a case, at most; default {DEFAULT_SECONDS:g}",
    )
    run.add_argument("--strata", nargs="+", choices=STRATA, help="these strata alone")
    run.add_argument("--limit", type=_count, help="the first cases alone")
    run.add_argument("command", nargs="*", metavar="CMD", help="takes a folder; after -- as it is")
    grade = verbs.add_parser("grade", help="print the marks of every case of a run, as JSON")
    grade.add_argument("answers", type=Path)
    table = verbs.add_parser("table", help="compare runs; differences are against the first")
    table.add_argument("runs", nargs="+", metavar="NAME=ANSWERS")
    draw = verbs.add_parser("draw", help="draw a set of new campaigns; needs the extra [draw]")
    draw.add_argument("folder", type=Path, help="folder, or file with the suffix .zip")
    draw.add_argument("--seed", type=int, help="seed of a set to tune with")
    draw.add_argument("--archive", type=Path, help="archive of the entry; with --beacon: its seed")
    draw.add_argument("--beacon", help="value that was published after the archive")
    draw.add_argument("--count", type=_count, default=5, help="cases of each stratum; default 5")
    draw.add_argument("--strata", nargs="+", choices=STRATA, help="these strata alone")
    for verb in (run, grade, table):
        verb.add_argument("--set", type=Path, default=BUNDLED, dest="cases", help="folder or .zip")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run a verb; return the exit code."""
    given = _parse(sys.argv[1:] if arguments is None else arguments)
    try:
        if given.verb == "draw":
            return _draw(given)
        with open_set(given.cases) as (folder, keys):
            if given.verb == "run":
                run_entry(
                    given.command,
                    folder,
                    keys,
                    given.out,
                    seconds=given.seconds,
                    strata=given.strata,
                    limit=given.limit,
                )
            elif given.verb == "grade":
                print(json.dumps(grade_file(given.answers, keys), indent=1))
            else:
                pairs = [run.partition("=") for run in given.runs]
                if bare := [name for name, equals, _ in pairs if not equals]:
                    raise RunError(f"{bare[0]}: give NAME=ANSWERS, such as mine={bare[0]}")
                print(markdown({name: grade_file(Path(path), keys) for name, _, path in pairs}))
    except (RunError, OSError, UnicodeDecodeError) as error:
        print(f"gapbench: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("gapbench: interrupted; the same command goes on from here", file=sys.stderr)
        return INTERRUPTED
    return 0


def _draw(given: argparse.Namespace) -> int:
    try:
        from gapbench.draw import draw_set  # noqa: PLC0415  # the extra [draw]
    except ImportError as error:
        raise RunError(f"draw needs {error.name}: pip install 'gapbench[draw]'") from error
    if (given.seed is None) == (given.archive is None) or bool(given.archive) != bool(given.beacon):
        raise RunError("give --seed, or --archive and --beacon")
    seed = given.seed
    if seed is None:
        seed = seed_of(given.archive.read_bytes(), given.beacon)
    draw_set(given.folder, seed, given.count, given.strata or STRATA)
    print(f"seed {seed}", file=sys.stderr)
    if seed in TAKEN_SEEDS:
        print(f"seed {seed} gives {TAKEN_SEEDS[seed]}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
