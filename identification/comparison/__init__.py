"""Tests beside each other: of one machine before and after, of two machines, of a fleet."""

from identification.comparison.campaign_comparison import (
    CellDifference,
    TestComparison,
    compare_frfs,
    compare_tests,
    name_campaigns,
)
from identification.comparison.compared_modes import (
    ComparedMode,
    FleetScatter,
    Shift,
    TestedModes,
    VisitDrift,
    compute_scatter,
    compute_shifts,
    pair_tests,
)
from identification.comparison.sentences import describe_fleet, describe_shifts

__all__ = [
    "CellDifference",
    "ComparedMode",
    "FleetScatter",
    "Shift",
    "TestComparison",
    "TestedModes",
    "VisitDrift",
    "compare_frfs",
    "compare_tests",
    "compute_scatter",
    "compute_shifts",
    "describe_fleet",
    "describe_shifts",
    "name_campaigns",
    "pair_tests",
]
