"""Figures on what stands behind stated probabilities: constants, rules and steps of the search."""

from diagnosis.inference.calibration import load_calibration
from tests.bench.calibrate import log_likelihood
from tests.docs.formats import fixed, significant, table
from tests.docs.results import bench_values


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
    "calibrate-constants-table": constants_table,
    "calibrate-campaigns": calibration_campaigns,
    "calibrate-nats": calibration_surprise,
}
