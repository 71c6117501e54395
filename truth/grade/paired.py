r"""Compare two engines on the same cases: difference of paired proportions.

With a cases that both have right, b that the first alone has, c that the second alone has, and d
that neither has, the difference of the rates is (b - c) / n. Its 95 % interval is Newcombe's
(1998, method 10): Wilson's intervals of both rates, joined with their correlation

    phi = (a d - b c) / sqrt((a + b)(c + d)(a + c)(b + d)),

a continuity correction taken off a positive numerator. McNemar's exact test asks whether b and c
are halves of b + c.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from truth.grade.rates import wilson


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
