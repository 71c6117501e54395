"""``make same BASE=commit``: show that a version computes what an earlier one did.

Both versions identify, tune and diagnose the same campaigns on this machine, with the same
dependencies. Every key and every number of every JSON file that they write must agree, digit by
digit; sentences may change and are printed side by side. FRFs must take the same time within 5 %.
What BASE wrote is kept in ``.same/``, so that a second comparison runs the new version alone.
"""

import argparse
import filecmp
import json
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.regression.results import changed_numbers, compare_files, show_difference
from tests.regression.versions import (
    ROOT,
    Version,
    check_out,
    install_effects,
    working_tree,
)

WORK = ROOT / ".same"
OPEN_CAMPAIGNS = ROOT.parent / "shared" / "campaigns" / "open"
SLOWER = 1.05  # largest ratio of times that counts as equal
FRF_ROUNDS = 3
VERBS = {"identify": "modes.json", "tune": "tuned.json", "diagnose": "verdict.json"}
CODES = "exit_codes.json"
STATION = "assets/microstation/station.xml"
DRAWN = {
    "inerter": (STATION, "--seed", "424201", "--node", "11", "--effect", "inerter"),
    "protocol": ("tree", "--seed", "424202", "--effect", "mass_error", "--drawn-protocol"),
}


@dataclass(frozen=True)
class Work:
    """One campaign and how it is run.

    Attributes:
        name: of its folder of results.
        campaign: its folder.
        with_effects: whether the example of a user's effect is installed.
    """

    name: str
    campaign: Path
    with_effects: bool = False


def main() -> int:
    """Compare the working tree with a commit; return 0 if both compute the same."""
    parser = argparse.ArgumentParser(prog="make same", description=__doc__)
    parser.add_argument("base", help="commit to compare with")
    parser.add_argument("--only", nargs="*", help="names of campaigns, or frf; default: all")
    chosen = parser.parse_args()
    names = {*DRAWN, "demo", "frf", *(path.name for path in OPEN_CAMPAIGNS.glob("*"))}
    if unknown := sorted(set(chosen.only or []) - names):
        parser.error(f"no campaign {', '.join(unknown)}; there are {', '.join(sorted(names))}")
    base, now = check_out(chosen.base, WORK), working_tree(WORK)
    effects = install_effects(base.root / "assets" / "inerter_effect", WORK / "effects")
    faults = list(_draw(base, now))
    for work in _campaigns(base, chosen.only):
        for version in (base, now):
            _run(version, work, effects, keep=version is base)
        faults += _compare(base.results / work.name, now.results / work.name, work.name)
    if not chosen.only or "frf" in chosen.only:
        faults += _frf_times(base, now)
    for fault in faults:
        print(f"DIFFERS  {fault}")
    print("different" if faults else "the same")
    return 1 if faults else 0


def _campaigns(base: Version, only: list[str] | None) -> Iterator[Work]:
    yield from (
        work
        for work in (
            Work("demo", base.root / "assets" / "demo"),
            *(Work(name, base.results / "drawn" / name, name == "inerter") for name in DRAWN),
            *(Work(path.name, path) for path in sorted(OPEN_CAMPAIGNS.glob("*"))),
        )
        if not only or work.name in only
    )


def _draw(base: Version, now: Version) -> Iterator[str]:
    """Draw campaigns by both versions; yield those whose files differ."""
    for name, (model, *options) in DRAWN.items():
        folders = [version.results / "drawn" / name for version in (base, now)]
        for version, folder in zip((base, now), folders, strict=True):
            if version is now:
                shutil.rmtree(folder, ignore_errors=True)
            if not folder.is_dir():
                code = version.python("-m", "truth", model, folder, *options)
                if code:
                    yield f"drawing {name} ended with exit code {code}"
        files = {
            str(path.relative_to(folder))
            for folder in folders
            for path in folder.rglob("*")
            if path.is_file()
        }
        same, _, _ = filecmp.cmpfiles(*folders, sorted(files), shallow=False)
        yield from (f"drawn {name}/{file}" for file in sorted(files - set(same)))


def _run(version: Version, work: Work, effects: Path, *, keep: bool) -> None:
    """Identify, tune and diagnose one campaign; exit codes go beside the results."""
    folder = version.results / work.name
    done = folder / CODES
    if keep and done.is_file():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    codes = {}
    for verb in VERBS:
        options = ["--jobs", "2"] if verb == "diagnose" else []
        call = ("-m", "mbw", verb, work.campaign, "--out", folder / verb, "--quiet", *options)
        codes[verb] = version.python(*call, effects=effects if work.with_effects else None)
    done.write_text(json.dumps(codes), encoding="utf-8")


def _compare(before: Path, after: Path, name: str) -> Iterator[str]:
    """Yield what differs in the JSON files of one campaign; print sentences that changed."""
    names = [
        {str(path.relative_to(folder)) for path in folder.rglob("*.json")}
        for folder in (before, after)
    ]
    yield from (f"{name}/{file} is missing on one side" for file in sorted(names[0] ^ names[1]))
    codes = json.loads((before / CODES).read_text(encoding="utf-8"))
    for verb, file in VERBS.items():
        # A verb may end with another code, such as 4 for not converged; its file must be there.
        if f"{verb}/{file}" not in names[0]:
            yield f"{name}: {verb} of BASE ended with exit code {codes[verb]} and no {file}"
    for file in sorted(names[0] & names[1]):
        for difference in compare_files(before / file, after / file):
            text = f"{name}/{file} {show_difference(difference)}"
            if not difference.is_sentence:
                yield text
            elif any(changed_numbers(difference)):
                yield f"numbers in a sentence: {text}"
            else:
                print(text)
    print(f"{name}: {len(names[0] & names[1])} JSON files compared", flush=True)


def _frf_times(base: Version, now: Version) -> Iterator[str]:
    """Yield the works of the FRF bench that are slower than before, in alternating runs."""
    code = (
        "import json; from threadpoolctl import threadpool_limits; from tests.bench import frf\n"
        "with threadpool_limits(1): rows = frf.run()\n"
        "open({path!r}, 'w').write(json.dumps(rows))"
    )
    best: list[dict[str, float]] = [{}, {}]
    for _ in range(FRF_ROUNDS):
        for version, times in zip((base, now), best, strict=True):
            path = version.results / "frf.json"
            if version.python("-c", code.format(path=str(path))):
                yield "the FRF bench failed"
                return
            for row in json.loads(path.read_text(encoding="utf-8")):
                if "ours" in row["work"]:
                    times[row["work"]] = min(row["ms"], times.get(row["work"], row["ms"]))
    yield from (f"{work} is timed on one side only" for work in best[0].keys() ^ best[1].keys())
    for work in best[0].keys() & best[1].keys():
        before, after = best[0][work], best[1][work]
        print(f"{work}: {before:.2f} ms before, {after:.2f} ms now, {after / before:.3f}")
        if after / before > SLOWER:
            yield f"{work} takes {after / before:.3f} of the time before"


if __name__ == "__main__":
    sys.exit(main())
