"""Explanations of technical words, shown on every page where the words stand.

Each text is the beginning of the entry of that name in ``docs/glossary.md``, without its formulas;
a test compares both.
"""

import re
from html import escape

# Words as a page writes them, by the name of their entry; the longest alternative stands first.
_WORDS = {
    "Nat": r"nats?",
    "Pull": r"pulls?",
    "Collinearity (MPC)": r"MPC|modal phase collinearity|collinearity",
    "MAC": r"MAC",
    "COMAC": r"COMAC",
    "CMIF": r"CMIF",
    "MMIF": r"MMIF",
    "Excess": r"excess",
    "Coherence": r"coherence",
    "Held-out lines": r"held[- ]out",
    "Score test": r"score tests?",
    "Null model": r"null model",
    "Nominal model": r"nominal model",
    "Residual gap": r"residual gap",
    "Model-error floor": r"model-error floor",
    "Free-force marginal likelihood": r"free-force marginal likelihood|free force",
    "Survival ratio": r"survival ratio",
    "Redundant channels": r"redundant channels",
    "Confounded causes": r"confounded causes",
    "Crossover": r"crossover",
    "Delay margin": r"delay margin",
    "Loop gain": r"loop gain",
    "Modulus margin": r"modulus margin|modulus",
    "Robust stability": r"robustly stable|robust stability",
    "Sensitivity": r"sensitivity peak",
    "Tolerance": r"tolerances?",
}
EXPLANATIONS = {
    "Nat": "Unit of a log likelihood with the natural logarithm; 3 nats are odds of 20 to 1.",
    "Pull": "Shift of a tolerance in units of its prior's standard deviation.",
    "Collinearity (MPC)": "Modal phase collinearity: 1 where a mode shape is real but for one "
    "common phase.",
    "MAC": "Modal assurance criterion: squared cosine of two mode shapes, between 0 and 1.",
    "COMAC": "Coordinate modal assurance criterion: squared cosine of two sets of mode shapes at "
    "one channel, taken over their modes; 1 where the channel agrees in all of them.",
    "CMIF": "Complex mode indicator function: the singular values of the FRF matrix at each line.",
    "MMIF": "Multivariate mode indicator function: the smallest share of the response that is in "
    "phase with the force, at each line; it drops towards 0 at a mode.",
    "Excess": "The error in units of the noise, root mean square over all channels; 1.0 is a "
    "perfect model.",
    "Coherence": "Share of the response power that is linear in the force.",
    "Held-out lines": "Lines that a fit did not see and that it then predicts; the figures to "
    "quote are those on held-out lines.",
    "Score test": "Lagrange multiplier test: the gain of releasing a hypothesis, from gradient "
    "and normal equations at a fit without it.",
    "Null model": "The model without any effect, tuned with all tolerances; its gap is retuned.",
    "Nominal model": "The model before tuning; many messages call it \"the drawing\" and its "
    "values \"as drawn\".",
    "Residual gap": "The gap that a fit leaves: mean square of its residual over that of the "
    "noise, minus one.",
    "Model-error floor": "Relative model discrepancy that a fit tolerates, added to the noise "
    "variance as a share of the motion.",
    "Free-force marginal likelihood": "Gain in log evidence when an unknown force of any spectrum "
    "may act at one place in one direction.",
    "Survival ratio": "What a refit without the effect leaves of an effect, over the noise.",
    "Redundant channels": "Channels of a body beyond the rigid-body motions that they determine.",
    "Confounded causes": "Causes that these data cannot tell apart.",
    "Crossover": "Frequency above which the loop gain stays below one.",
    "Delay margin": "Delay that a loop bears beyond its own before it is unstable.",
    "Loop gain": "Product of plant and controller, whose critical point is -1; with several "
    "loops, all others are closed.",
    "Modulus margin": "Smallest distance of the loop gain from -1, the inverse of the largest "
    "sensitivity.",
    "Robust stability": "Stability for every plant within a weight W: the largest |W T| is below "
    "1, with T the complementary sensitivity.",
    "Sensitivity": "What a closed loop leaves of a disturbance at its output, S = 1 / (1 + L) "
    "with the loop gain L.",
    "Tolerance": "One standard deviation of what the drawings state, such as 2 % of mass or 1° of "
    "a sensor's axes; also the parameter with that prior.",
}  # fmt: skip
_GROUPS = {f"word{number}": name for number, name in enumerate(_WORDS)}
_PATTERN = re.compile(
    r"(?<![\w@:/.-])(?:"
    + "|".join(f"(?P<{group}>{_WORDS[name]})" for group, name in _GROUPS.items())
    + r")(?![\w@/-]|:\S)",
    re.IGNORECASE,
)
_TAG = re.compile(r"(<[^>]*>)")
_UNTOUCHED = {"script", "style", "abbr", "code", "button", "title", "pre", "h1", "h2"}


def explain_words(html: str) -> str:
    """Return HTML in which the first occurrence of a word in each section has its explanation.

    A section begins at a heading ``h2``; in the head of a table a word is explained again.

    Args:
        html: fragment of a page; ``>`` stands in no attribute.
    """
    parts, explained, untouched, is_head = [], set[str](), 0, False

    def explain(match: re.Match[str]) -> str:
        name = _GROUPS[str(match.lastgroup)]
        if name in explained and not is_head:
            return match[0]
        explained.add(name)
        return f'<abbr title="{escape(EXPLANATIONS[name])}">{match[0]}</abbr>'

    for part in _TAG.split(html):
        if not part.startswith("<"):
            parts.append(part if untouched else _PATTERN.sub(explain, part))
            continue
        tag = re.sub(r"[^a-z0-9].*", "", part.lstrip("</").lower(), flags=re.DOTALL)
        if tag in _UNTOUCHED:
            untouched += -1 if part.startswith("</") else 1
        if tag == "h2":
            explained.clear()
        is_head = (not part.startswith("</")) if tag in ("th", "thead") else is_head
        parts.append(part)
    return "".join(parts)
