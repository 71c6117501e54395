"""Figures of the bench of live tests."""

from tests.docs.formats import table
from tests.docs.results import bench_rows


def live_hits() -> str:
    """Bad hits that were refused before the next one, and good ones that were refused."""
    rows = [row for row in bench_rows("live") if "hits" in row]
    bad = [row for row in rows if row["hits"] != "good"]
    total = {name: sum(row[name] for row in bad) for name in ("of", "refused")}
    shown = [*bad, {"hits": "all bad ones", **total}, *(row for row in rows if row not in bad)]
    return table(
        ("Hits", "Number", "Refused", "Share [%]"),
        [
            (
                row["hits"],
                str(row["of"]),
                str(row["refused"]),
                f"{100 * row['refused'] / max(row['of'], 1):.1f}",
            )
            for row in shown
        ],
    )


def live_stops() -> str:
    """Verdicts at the stop beside those of the whole plan."""
    rows = [row for row in bench_rows("live") if "stops" in row]
    return table(
        ("Machine", "Tests", "Verdict of the full plan", "With a wrong cause", "Hits [%], median"),
        [
            (
                row["stops"],
                str(row["of"]),
                str(row["verdict of the full plan"]),
                str(row["wrong causes"]),
                f"{100 * row['share of hits']:.0f}" if row["of"] else "-",
            )
            for row in rows
        ],
    )


def live_cases() -> str:
    """Number of simulated tests."""
    return str(next(row["cases"] for row in bench_rows("live") if "cases" in row))


FIGURES = {"live-hits-table": live_hits, "live-stops-table": live_stops, "live-cases": live_cases}
