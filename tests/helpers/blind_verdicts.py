"""Verdicts that stand in for a diagnosis in tests of ``mbw blind``."""


def empty_verdict(none: float = 1.0, excess: float = 2.0) -> dict[str, object]:
    """Return a verdict without causes in the format of verdict.json.

    Args:
        none: probability that nothing is missing.
        excess: of the nominal model.
    """
    return {
        "verdict": "none" if none > 0.5 else "unexplained",
        "probability": {"none": none, "unexplained": 1 - none, "several": 0.0},
        "gap": {
            "as_drawn": {"error": 1.0, "excess": excess},
            "retuned": {"error": 0.1, "excess": 1.0},
            "after": {"error": None, "excess": None},
            "noise": 0.1,
            "closed": None,
            "interval": {"closed": None, "after": None},
        },
        "where": [],
        "causes": [],
        "twins": [],
        "not_testable": [],
        "next_experiment": "",
    }
