"""Figures on stated probabilities: how often they are true, and the constants behind them."""

import re
from collections.abc import Sequence
from functools import cache
from importlib import import_module

from diagnosis.inference.calibration import load_calibration
from tests.bench.calibrate import log_likelihood
from tests.docs.formats import fixed, percent, significant, table
from tests.docs.grades import seeds_fragment
from tests.docs.results import bench_cases, bench_values, grade_tables

STATED = re.compile(
    r"true of causes stated (?P<low>[\d.]+) to (?P<high>[\d.]+), (?P<mean>[\d.]+) in the mean, "
    r"of doubt, catalogue and protocols, % \[(?P<least>[\d.]+), (?P<most>[\d.]+)\]"
)


@cache
def stated_rates() -> Sequence[tuple[str, str, str, int]]:
    """Return how often causes are true that three benches state with some probability.

    The bench itself counts them in the kept cases: ``doubt.json`` is older than some of these.

    Returns:
        For each range of stated probabilities: the range, its mean, the rate and n.
    """
    doubt = import_module("tests.bench.doubt")  # loads the diagnosis, which no other figure needs
    cases = [
        row for bench, first in doubt.REPORTED for row in doubt.of(f"{bench}.{first}").values()
    ]
    rows = []
    for row in doubt.reliability(cases):
        match = STATED.fullmatch(row["figure"])
        if match is not None:
            interval = f"[{100 * float(match['least']):.1f}, {100 * float(match['most']):.1f}]"
            stated = f"{match['low']} to {match['high']}"
            rows.append((stated, match["mean"], f"{row['value']:.1f} % {interval}", row["n"]))
    return rows


def doubt_table() -> str:
    """How often causes are true that three benches state with some probability."""
    return table(("Stated probability", "Mean", "True [95 % interval]", "n"), stated_rates())


def doubt_hidden() -> str:
    """Number of weak effects that the verdict calls nothing missing."""
    said = grade_tables("doubt")["confusion of effects"].values()
    hidden = sum(int(row["none"]) for row in said if row["none"] != ".")
    count = len(bench_cases("doubt.330000"))
    return f"{hidden} of {count} ({percent(hidden / count, 0)})"


def constants_table() -> str:
    """Calibrated constants of the posterior probabilities."""
    constants = load_calibration()
    rows = [
        (f"`hidden.{source}`", significant(value)) for source, value in constants.hidden.items()
    ]
    rows += [
        (f"`{name}`", significant(getattr(constants, name)))
        for name in (
            "hidden_width",
            "error_values",
            "noise_exponent",
            "tolerance_weight",
            "force_scale",
        )
    ]
    return table(("Constant", "Value"), rows)


def calibration_campaigns() -> str:
    """Number of campaigns that the constants are calibrated on."""
    return str(load_calibration().campaigns)


def calibration_surprise() -> str:
    """Mean -ln(probability of the truth) of these campaigns."""
    return f"{-log_likelihood(load_calibration()) / load_calibration().campaigns:.2f}"


def posterior_rules_table() -> str:
    """How often an entirely right verdict is probable without each rule of the posterior."""
    return _ablation_table("posterior_rules", "Rules", ("nats a campaign", 2))


def search_rungs_table() -> str:
    """How often a verdict is right without each rung of the search, and how long it takes."""
    return _ablation_table("ablation", "Search", ("core seconds, mean", 0))


def _ablation_table(bench: str, subject: str, extra: tuple[str, int]) -> str:
    """Return rates without each of several things, with their differences from all.

    Args:
        bench: name of the bench.
        subject: header of the first column.
        extra: a further figure of each row, and its digits.
    """
    values = bench_values(bench)
    further, digits = extra
    rows = []
    for name in (figure.removesuffix(": right, %") for figure in values if "right" in figure):
        right, more = values[f"{name}: right, %"], values[f"{name}: {further}"]
        less = values.get(f"{name}: difference, %")
        difference = "" if less is None else f"{fixed(less['value'], 1)} {_interval(less['n'])}"
        rows.append(
            (
                name,
                fixed(right["value"], 1),
                _interval(right["n"]),
                difference,
                fixed(more["value"], digits),
            )
        )
    header = (subject, "Right, %", "95 % interval", "Difference, %", further.capitalize())
    return table(header, rows)


def _interval(count: str) -> str:
    """Return the interval of a figure's n."""
    return count[count.index("[") :]


FIGURES = {
    "posterior-rules-table": posterior_rules_table,
    "search-rungs-table": search_rungs_table,
    "doubt-table": doubt_table,
    "doubt-campaigns": lambda: str(len(bench_cases("doubt.330000"))),
    "doubt-seeds": seeds_fragment("doubt.330000"),
    "doubt-stated-sure": lambda: "{2} (n = {3})".format(*stated_rates()[-1]),
    "doubt-hidden": doubt_hidden,
    "calibrate-constants-table": constants_table,
    "calibrate-campaigns": calibration_campaigns,
    "calibrate-nats": calibration_surprise,
}
