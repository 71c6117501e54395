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

from tests.regression.results import compare_files, show_difference
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
VERBS = ("identify", "tune", "diagnose")
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
    parser.add_argument("--only", nargs="*", help="names of campaigns; default: all")
    chosen = parser.parse_args()
    base, now = check_out(chosen.base, WORK), working_tree(WORK)
    effects = install_effects(base.root / "assets" / "inerter_effect", WORK / "effects")
    faults = list(_draw(base, now))
    for work in _campaigns(base, chosen.only):
        for version in (base, now):
            _run(version, work, effects, keep=version is base)
        faults += _compare(base.results / work.name, now.results / work.name, work.name)
    if not chosen.only:
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
        files = sorted(path.name for path in folders[0].iterdir() if path.is_file())
        same, _, _ = filecmp.cmpfiles(*folders, files, shallow=False)
        yield from (f"drawn {name}/{file}" for file in sorted(set(files) - set(same)))


def _run(version: Version, work: Work, effects: Path, *, keep: bool) -> None:
    """Identify, tune and diagnose one campaign; exit codes go beside the results."""
    folder = version.results / work.name
    done = folder / "exit_codes.json"
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
    for file in sorted(names[0] & names[1]):
        for difference in compare_files(before / file, after / file):
            text = f"{name}/{file} {show_difference(difference)}"
            if difference.is_sentence:
                print(text)
            else:
                yield text
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
    for (work, before), after in zip(best[0].items(), best[1].values(), strict=True):
        print(f"{work}: {before:.2f} ms before, {after:.2f} ms now, {after / before:.3f}")
        if after / before > SLOWER:
            yield f"{work} takes {after / before:.3f} of the time before"


if __name__ == "__main__":
    sys.exit(main())
