"""Findings on parameters and on further tests, which tuned.json holds as they are."""

from identification.readers.result_files import StrictRow


class CorrelationRow(StrictRow):
    """Two parameters that the data hardly distinguish."""

    first: str
    second: str
    correlation: float


class UnseenRow(StrictRow):
    """A direction that the data do not determine."""

    parameters: list[str]
    deviation: float
    sentence: str


class GainRow(StrictRow):
    """Effect of one further measurement on the most uncertain parameter.

    ``what`` is a hammer point at a site, or a sensor beside it. ``before`` and ``after`` are
    standard deviations of ``parameter`` (relative for sizes). ``shrink`` is the median of
    after / before over all stiffnesses and dampings.
    """

    what: str
    place: str
    parameter: str
    before: float
    after: float
    shrink: float
