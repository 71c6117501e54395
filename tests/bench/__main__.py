"""``make bench ONLY=name``: measurements too long for the tests; results kept beside this file.

Each bench prints its table and writes ``results/<name>.json``, which README quotes. Speeds are
ratios measured in one run, alternating, one BLAS thread: absolute times belong to one machine.
"""

import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from tests.bench import (
    ablation,
    algorithms,
    calibrate,
    compare,
    coverage,
    excitation,
    frf,
    fuzz,
    gallery,
    gondola,
    gondola_frames,
    held_out,
    identify,
    intervals,
    large,
    large_identify,
    leaks,
    live,
    machine_size,
    measured,
    nlopt_starts,
    plant_coverage,
    posterior_rules,
    properties,
    real,
    reciprocity,
    resume,
    scorecard,
    simulate,
    smallest_sizes,
    starts,
    survival,
    truth,
    tune,
    without_hammer,
    workbench,
    written_models,
)
from tests.bench.kept import only_kept

BENCHES = {
    "ablation": ablation.run,
    "algorithms": algorithms.run,
    "calibrate": calibrate.run,
    "compare": compare.run,
    "coverage": coverage.run,
    "excitation": excitation.run,
    "frf": frf.run,
    "fuzz": fuzz.run,
    "gallery": gallery.run,
    "gondola": gondola.run,
    "gondola_frames": gondola_frames.run,
    "held_out": held_out.run,
    "identify": identify.run,
    "intervals": intervals.run,
    "large": large.run,
    "large_identify": large_identify.run,
    "leaks": leaks.run,
    "live": live.run,
    "machine_size": machine_size.run,
    "measured": measured.run,
    "nlopt_starts": nlopt_starts.run,
    "plant_coverage": plant_coverage.run,
    "posterior_rules": posterior_rules.run,
    "properties": properties.run,
    "real": real.run,
    "reciprocity": reciprocity.run,
    "resume": resume.run,
    "scorecard": scorecard.run,
    "simulate": simulate.run,
    "smallest_sizes": smallest_sizes.run,
    "starts": starts.run,
    "survival": survival.run,
    "truth": truth.run,
    "tune": tune.run,
    "without_hammer": without_hammer.run,
    "workbench": workbench.run,
    "written_models": written_models.run,
}
RESULTS = Path(__file__).parent / "results"


def main(chosen: list[str]) -> int:
    unknown = [name for name in chosen if name not in BENCHES]
    if unknown:
        Console(stderr=True).print(f"no bench {', '.join(unknown)}; there are {', '.join(BENCHES)}")
        return 2
    RESULTS.mkdir(exist_ok=True)
    for name in chosen or BENCHES:
        with threadpool_limits(1):
            rows = BENCHES[name]()
        table = Table(*rows[0], title=name)
        for row in rows:
            table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()))
        Console().print(table)
        if not only_kept():
            text = json.dumps(rows, indent=1) + "\n"
            (RESULTS / f"{name}.json").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
