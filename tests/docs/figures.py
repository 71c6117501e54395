"""Every figure that a page may quote: KEY -> what makes its Markdown from committed results.

A page holds ``<!-- bench:KEY -->...<!-- /bench -->``; ``python -m tests.docs`` writes what stands
between the markers, ``python -m tests.docs --list`` prints all keys. ``headlines`` and keys that
end in ``-table`` are tables, all others fragments of a sentence. The name before
the first dash is that of the bench.
"""

from collections.abc import Callable, Mapping

from tests.docs import (
    calibration_figures,
    gapbench_figures,
    headline_figures,
    live_figures,
    measured_figures,
    model_figures,
    modes_figures,
    scorecard_figures,
    simulation_figures,
    truth_figures,
    tuning_figures,
    workbench_figures,
)

FIGURES: Mapping[str, Callable[[], str]] = {
    **headline_figures.FIGURES,
    **scorecard_figures.FIGURES,
    **measured_figures.FIGURES,
    **calibration_figures.FIGURES,
    **model_figures.FIGURES,
    **modes_figures.FIGURES,
    **tuning_figures.FIGURES,
    **truth_figures.FIGURES,
    **simulation_figures.FIGURES,
    **workbench_figures.FIGURES,
    **live_figures.FIGURES,
    **gapbench_figures.FIGURES,
}
