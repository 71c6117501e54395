r"""The statistics of a grading: rates with Wilson intervals, spreads, reliability diagrams.

Two engines on the same cases are compared by the difference of paired proportions. With a cases
that both have right, b that the first alone has, c that the second alone has, and d that neither
has, the difference of the rates is (b - c) / n. Its 95 % interval is Newcombe's (1998, method 10):
Wilson's intervals of both rates, joined with their correlation

    phi = (a d - b c) / sqrt((a + b)(c + d)(a + c)(b + d)),

a continuity correction taken off a positive numerator. McNemar's exact test asks whether b and c
are halves of b + c.

This module imports the standard library alone: the distribution of ``gapbench`` ships it as well.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean

CONFIDENCE = 0.95
BINS = ((0.0, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.0))


@dataclass(frozen=True)
class Rate:
    """A rate among n; None where n is 0.

    Args:
        n: how many were counted.
        hits: how many of them hold; an expected number if each holds with a probability.
        rate: hits / n.
        low, high: 95 % interval of Wilson; None for an expectation, which is exact.
    """

    n: int
    hits: float
    rate: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Spread:
    """How n numbers lie: mean, median, 90 % quantile and largest; None where n is 0."""

    n: int
    mean: float | None
    median: float | None
    ninety: float | None
    largest: float | None


@dataclass(frozen=True)
class Bin:
    """What was stated with a probability in [low, high), and how often it was true.

    Args:
        low, high: of the bin; the last one holds 1 too.
        stated: mean probability stated; None if nothing was.
        true: how often it was true.
    """

    low: float
    high: float
    stated: float | None
    true: Rate


@dataclass(frozen=True)
class Diagram:
    """A reliability diagram.

    Args:
        n: statements.
        bins: as ``BINS``.
        error: expected calibration error, sum of n_bin / n |stated - true|; None without any.
    """

    n: int
    bins: tuple[Bin, ...]
    error: float | None


def wilson(hits: float, n: int) -> tuple[float, float]:
    r"""Return the 95 % interval of a rate (Wilson 1927).

    With p = hits / n and z = 1.96 it is (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) /
    (1 + z^2/n): the rates from which p is z standard deviations away.

    Args:
        hits: from 0 to n.
        n: at least 1.

    Raises:
        ValueError: hits or n are outside.
    """
    if n < 1 or not 0 <= hits <= n:
        raise ValueError(f"wilson: {hits} of {n}; expected hits from 0 to n, n at least 1")
    z = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
    p = hits / n
    middle = p + z**2 / (2 * n)
    half = z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    low, high = ((middle + sign * half) / (1 + z**2 / n) for sign in (-1, 1))
    return 0.0 if hits == 0 else low, 1.0 if hits == n else high


def rate_of(marks: Iterable[float | None]) -> Rate:
    """Return the rate of marks from 0 to 1; None is not counted."""
    counted = [mark for mark in marks if mark is not None]
    if not counted:
        return Rate(0, 0.0, None, None, None)
    hits = math.fsum(counted)
    rate = hits / len(counted)
    if any(mark not in (0, 1) for mark in counted):
        return Rate(len(counted), hits, rate, None, None)
    return Rate(len(counted), hits, rate, *wilson(hits, len(counted)))


def quantile(values: Sequence[float], part: float) -> float:
    """Return a quantile, linear between the sorted values; at least one value."""
    ordered = sorted(values)
    at = part * (len(ordered) - 1)
    below = min(int(at), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (at - below) * (ordered[above] - ordered[below])


def spread_of(values: Iterable[float | None]) -> Spread:
    """Return how numbers lie; None is not counted."""
    counted = [value for value in values if value is not None]
    if not counted:
        return Spread(0, None, None, None, None)
    middle, ninety = quantile(counted, 0.5), quantile(counted, 0.9)
    return Spread(len(counted), fmean(counted), middle, ninety, max(counted))


def diagram_of(statements: Iterable[tuple[float, bool]]) -> Diagram:
    """Return the reliability diagram of (probability stated, whether it was true).

    Raises:
        ValueError: a probability is outside 0 to 1.
    """
    given = list(statements)
    if not all(0 <= stated <= 1 for stated, _ in given):
        raise ValueError("diagram: a probability lies outside 0 to 1")
    bins, error = [], 0.0
    for low, high in BINS:
        inside = [pair for pair in given if low <= pair[0] < high or pair[0] == high == 1]
        true = rate_of(float(is_true) for _, is_true in inside)
        stated = fmean(probability for probability, _ in inside) if inside else None
        if stated is not None and true.rate is not None:
            error += len(inside) / len(given) * abs(stated - true.rate)
        bins.append(Bin(low, high, stated, true))
    return Diagram(len(given), tuple(bins), error if given else None)


@dataclass(frozen=True)
class PairedDifference:
    """Rate of the first less that of the second, of the same cases.

    Args:
        n: cases.
        first_alone, second_alone: cases that one alone has right.
        difference: of the rates.
        low, high: 95 % interval of it.
        p_value: of McNemar's exact test, two-sided.
    """

    n: int
    first_alone: int
    second_alone: int
    difference: float
    low: float
    high: float
    p_value: float


def paired_difference(pairs: Iterable[tuple[bool, bool]]) -> PairedDifference:
    """Compare two engines.

    Args:
        pairs: of every case, whether the first and whether the second has it right.

    Raises:
        ValueError: there is no case.
    """
    given = [(bool(first), bool(second)) for first, second in pairs]
    if not given:
        raise ValueError("paired difference: there is no case; expected at least 1")
    a, b = given.count((True, True)), given.count((True, False))
    c, d = given.count((False, True)), given.count((False, False))
    n = len(given)
    first, second = (a + b) / n, (a + c) / n
    (low1, high1), (low2, high2) = wilson(a + b, n), wilson(a + c, n)
    phi = _correlation(a, b, c, d)
    difference = first - second
    down = _join_widths(first - low1, high2 - second, phi)
    up = _join_widths(high1 - first, second - low2, phi)
    return PairedDifference(n, b, c, difference, difference - down, difference + up, mcnemar(b, c))


def mcnemar(first_alone: int, second_alone: int) -> float:
    """Return the two-sided p of McNemar's exact test: a binomial with the probability 1/2."""
    n, fewer = first_alone + second_alone, min(first_alone, second_alone)
    tail: float = sum(math.comb(n, k) for k in range(fewer + 1)) / 2**n
    return min(1.0, 2 * tail)


def _join_widths(first: float, second: float, phi: float) -> float:
    return math.sqrt(max(0.0, first**2 - 2 * phi * first * second + second**2))


def _correlation(a: int, b: int, c: int, d: int) -> float:
    product = (a + b) * (c + d) * (a + c) * (b + d)
    if product == 0:
        return 0.0
    numerator = float(a * d - b * c)
    if numerator > 0:
        numerator = max(numerator - (a + b + c + d) / 2, 0.0)
    return numerator / math.sqrt(product)
