"""A fair judge: reads verdict files and sealed answers, and scores them.

It knows the files alone, and of the verdicts nothing but the contract. Baselines are judged on the
same cases by the same marks. What it yields is a ``Report``, a tree of frozen dataclasses that
``tables`` writes as text and ``to_json`` field by field::

    cases, failed {case: reason}, ungraded {case: reason}, remarks {case: [reason]}
    verdicts:   Scores
    baselines:  {name: {skipped {case: reason}, scores: Scores}}
    lines:      [what was said of each case, and its marks]
    Scores:     all: Group; by_effect, by_place, by_ratio, by_machine, by_tag: {label: Group};
                calibration {first, causes, shares: Diagram}; sizes; confusion
    Group:      n, rates {name: Rate}, means {name: Spread}, named as in RATES and MEANS
    Rate:       n, hits, rate, low, high
    Spread:     n, mean, median, ninety, largest
    Diagram:    n, bins [{low, high, stated, true: Rate}], error
    sizes:      size, size_of {effect}, parameters {effect: {parameter}}: {true, n, median, ninety};
                intervals: Rate, intervals_of {effect: Rate}
    confusion:  effects, kinds {truth: {said: n}}, places {machine: {truth: {said: n}}}
"""

from truth.grade.cases import CaseFiles
from truth.grade.marks import MEANS, RATES
from truth.grade.report import Report, grade, to_json
from truth.grade.scores import nearest_ratio
from truth.grade.text_tables import tables

__all__ = ["MEANS", "RATES", "CaseFiles", "Report", "grade", "nearest_ratio", "tables", "to_json"]
