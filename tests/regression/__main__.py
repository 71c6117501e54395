"""``make same BASE=commit``: show that a version computes what an earlier one did.

Both versions run the calls of ``calls.toml`` on this machine, with the same dependencies: every
verb, on the assets and on the open campaigns of ``../shared``. Every key and number of JSON, every
array, every line of MJCF, CSV and TOML and every exit code must agree, digit by digit; sentences
may change and are printed side by side. What is meant to differ stands in ``allowed.toml``. FRFs
must take the same time within 5 %.

What BASE wrote is kept in ``.same/``. Groups of the new version that are done are kept too while
no source file changes, so that an interrupted comparison goes on from where it was.
"""

import argparse
import json
import shutil
import sys
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.regression.compare import Difference, compare_folders, is_allowed
from tests.regression.versions import ROOT, Version, check_out, install_effects, working_tree

HERE = Path(__file__).parent
WORK = ROOT / ".same"
OPEN = ROOT.parent / "shared" / "campaigns" / "open"
OPEN_VERBS = ("identify", "tune", "diagnose")
WITH_EFFECTS = {"example"}  # groups for which the example of a user's effect is installed
GROUPS_AT_ONCE = 2
WITH_RESULTS = {0, 4}  # exit codes of calls that end with results
SLOWER = 1.05  # largest ratio of times that counts as equal
FRF_ROUNDS = 3
DONE = "done.json"

Groups = dict[str, dict[str, str]]


def main() -> int:
    """Compare the working tree with a commit; return 0 if both compute the same."""
    groups = read_groups()
    parser = argparse.ArgumentParser(prog="make same", description=__doc__)
    parser.add_argument("base", help="commit to compare with")
    parser.add_argument("--only", nargs="*", help="names of groups, or frf; default: all")
    chosen = parser.parse_args()
    if unknown := sorted(set(chosen.only or []) - {*groups, "frf"}):
        parser.error(f"no group {', '.join(unknown)}; there are {', '.join([*groups, 'frf'])}")
    names = [name for name in groups if not chosen.only or name in chosen.only]
    base, now = check_out(chosen.base, WORK), working_tree(WORK)
    effects = install_effects(next(base.root.glob("assets/*_effect")), WORK / "effects")
    with ThreadPoolExecutor(GROUPS_AT_ONCE) as pool:
        pairs = pool.map(lambda name: _run_both(base, now, name, groups[name], effects), names)
        faults = [fault for name in pairs for fault in _report(base, now, name)]
    if not chosen.only or "frf" in chosen.only:
        faults += _frf_times(base, now)
    for fault in faults:
        print(f"DIFFERS  {fault}")
    print("different" if faults else "the same")
    return 1 if faults else 0


def read_groups() -> Groups:
    """Return the calls of each group, by name; open campaigns are groups of their own."""
    groups: Groups = tomllib.loads((HERE / "calls.toml").read_text(encoding="utf-8"))
    for path in sorted(OPEN.glob("*/campaign.toml")):
        campaign = path.parent
        groups[campaign.name] = {verb: f"mbw {verb} {campaign}" for verb in OPEN_VERBS}
    return groups


def _run_both(base: Version, now: Version, name: str, calls: dict[str, str], effects: Path) -> str:
    """Run what is not done of a group by both versions; return its name."""
    for version in (base, now):
        _run(version, base.root, name, calls, effects)
    return name


def _run(version: Version, tree: Path, name: str, calls: dict[str, str], effects: Path) -> None:
    """Run the calls of a group where all versions run them, and keep what they wrote.

    Args:
        version: whose commands are called.
        tree: source tree whose assets are read.
        name: of the group.
        calls: words of each call, by its name.
        effects: folder with the package of a user's effect.
    """
    folder, running = version.results / name, WORK / "running" / name
    state = {"source": version.state(), "calls": calls}
    done = folder / DONE
    if done.is_file() and json.loads(done.read_text(encoding="utf-8"))["state"] == state:
        return
    for path in (folder, running):
        shutil.rmtree(path, ignore_errors=True)
    running.mkdir(parents=True)
    start, codes = time.monotonic(), {}
    for call, words in calls.items():
        module, *rest = words.format(tree=tree, here=running).split()
        if module == "mbw":
            rest += ["--out", str(running / call), "--json", f"{running / call}.json", "--quiet"]
        log = version.results / f"{name}.txt"
        uses = effects if name in WITH_EFFECTS else None
        codes[call] = version.python("-m", module, *rest, log=log, effects=uses)
    shutil.move(running, folder)
    row = {"state": state, "codes": codes, "seconds": round(time.monotonic() - start)}
    done.write_text(json.dumps(row), encoding="utf-8")


def _report(base: Version, now: Version, name: str) -> Iterator[str]:
    """Yield what differs in a group and may not; print sentences and what is meant."""
    folders = [version.results / name for version in (base, now)]
    rows = [json.loads((folder / DONE).read_text(encoding="utf-8")) for folder in folders]
    differences = list(compare_folders(*folders, ignored={DONE}))
    for call in rows[1]["codes"]:
        ends = [row["codes"].get(call) for row in rows]
        if ends[0] not in WITH_RESULTS:
            yield f"{name}/{call} of BASE ended with exit code {ends[0]}: see {base.results}"
        if ends[0] != ends[1]:
            differences.append(Difference(call, "exit code", *map(str, ends)))
    allowed = tomllib.loads((HERE / "allowed.toml").read_text(encoding="utf-8"))["allowed"]
    for difference in differences:
        reason = is_allowed(f"{name}/{difference.file}", difference.place, allowed)
        if difference.is_sentence:
            print(f"{name}/{difference}")
        elif reason is not None:
            print(f"allowed  {name}/{difference.file}, {difference.place}: {reason}")
        else:
            yield f"{name}/{difference}"
    count = sum(path.is_file() for path in folders[1].rglob("*"))
    codes = " ".join(f"{call} {code}" for call, code in rows[1]["codes"].items())
    print(f"{name}: {count} files, {rows[1]['seconds']} s, exit codes: {codes}", flush=True)


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
            path, log = version.results / "frf.json", version.results / "frf.txt"
            if version.python("-c", code.format(path=str(path)), log=log):
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
