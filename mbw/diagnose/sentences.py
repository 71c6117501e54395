"""Parts of a verdict as sentences: effects, places, confounded causes, results of data checks."""

from collections.abc import Collection, Sequence

from diagnosis.inference.evidence import Evidence
from diagnosis.labels import name_direction
from diagnosis.levels.free_levels import LAW_EFFECTS
from diagnosis.verdict.schema import CauseRow, Verdict
from diagnosis.verdict.sentences import (
    effect_noun,
    other_places,
    place_name,
    place_phrase,
)
from identification import exchange_phrase
from identification.words import capitalise
from mbw.diagnose.effect_parameters import (
    depends_on_doubtful_size,
    interval_words,
    parameter_words,
    parameters_that_may_be_zero,
)
from mbw.results.diagnosed_schema import ShownFile

_NO_COHERENCE_SENTENCE = (
    "the files hold no coherence of single inputs, or state no number of averages above one, so "
    "that the noise is estimated from third differences along frequency: this overestimates it at "
    "sharp modes, where gaps weigh little and an excess may fall below 1"
)
_CORRELATED_NOISE_SENTENCE = (
    "the noise of neighbouring frequency lines cannot be shown to be independent, because of a "
    "window in time, an average along frequency, sharp modes or few lines: small gaps may stay "
    "hidden"
)
_MIN_PREFERRED_PROBABILITY = 0.5  # of the first of confounded causes that the data prefer
_MIN_PREFERENCE_RATIO = 10.0  # its probability over that of the second
_UNKNOWN_LEVELS = "they need the level of every test in campaign.toml"
_UNTESTED: tuple[tuple[Collection[str], str], ...] = (
    (LAW_EFFECTS, "they need hits of several levels, each stated in campaign.toml"),
    ({"drift"}, "one direction of one set-up cannot reveal this"),
    (
        {"sensor_swap", "mount_resonance", "flexible_body"},
        "a body with fewer than two redundant channels cannot reveal this",
    ),
    (
        {
            *("sensor_gain", "sensor_misalignment", "sensor_position", "sensor_delay"),
            *("hammer_gain", "hammer_delay", "hammer_misalignment", "hammer_position"),
        },
        "[tuning] or [tolerance] in campaign.toml fixes some of these at their nominal values",
    ),
)


def places_sentences(verdict: Verdict) -> list[str]:
    """Return a sentence on each cause with several places, and on what its probability is."""
    return [
        f"{capitalise(effect_noun(row.effect))} {' or '.join(map(place_phrase, row.places))}: this "
        "test cannot tell these places apart; they are one cause, with the sum of their "
        "probabilities."
        for row in verdict.causes
        if other_places(row)
    ]


def cause_parameters(row: CauseRow) -> str:
    """Return the parameters of a cause with their units.

    A parameter that may be zero is stated with its interval. If the size of the effect may be
    zero, the parameters beside it are not known.
    """
    doubtful = parameters_that_may_be_zero(row.interval)
    texts = []
    for name, value in row.parameters.items():
        if name in doubtful:
            low, high = (float(end) for end in row.interval[name])  # type: ignore[arg-type]
            size = parameter_words(row.effect, row.dof, name, value)
            texts.append(f"{size} (95 %: {interval_words(row.effect, row.dof, name, (low, high))})")
        elif depends_on_doubtful_size(name, row.parameters, row.interval):
            texts.append(f"{name.replace('_', ' ')} not known")
        else:
            texts.append(parameter_words(row.effect, row.dof, name, value))
    return ", ".join(texts)


def site_words(site: str) -> str:
    """Return a site such as ``appendage@body:ty`` as text."""
    effect, _, location = site.partition("@")
    return f"{effect_noun(effect)} {place_phrase(location)}"


def noise_sentences(evidence: Evidence) -> list[str]:
    """Return sentences on noise without coherence, and on noise that lines may share."""
    sentences = [_NO_COHERENCE_SENTENCE] if evidence.variance == "differences" else []
    is_independent = evidence.null.serial is not None
    return sentences if is_independent else [*sentences, _CORRELATED_NOISE_SENTENCE]


def serial_correlation_sentences(evidence: Evidence) -> list[str]:
    """Return a sentence on the serial correlation of the residual, the basis of the verdict."""
    null = evidence.null
    if null.serial is None or not evidence.sets:
        return []
    least = min(fitted.gap for fitted in evidence.sets)
    before, after = (f"{max(gap, 0.0) ** 0.5:.2g}" for gap in (null.gap, least))
    return [
        f"The residual that neighbouring frequency lines have in common is {before} times the "
        f"noise without any effect and {after} times with the best set of effects; for noise alone "
        "it is close to zero."
    ]


def confounded_sentences(verdict: Verdict) -> list[str]:
    """Return a sentence on each set of confounded causes, and on a preference of the data."""
    shares = {f"{cause.effect}@{cause.location}": cause.probability for cause in verdict.causes}
    sentences = []
    one_cause = [{f"{row.effect}@{place}" for place in row.places} for row in verdict.causes]
    pairs = [
        pair for pair in verdict.twins if not any(sites.issuperset(pair) for sites in one_cause)
    ]
    for confounded in _join_pairs(pairs):
        sites = sorted(confounded, key=lambda site: (-shares.get(site, 0.0), site))
        more, less, *_ = (shares.get(site, 0.0) for site in sites)
        names = _join_words([site_words(site) for site in sites])
        if more > _MIN_PREFERRED_PROBABILITY and more >= _MIN_PREFERENCE_RATIO * less:
            sentences.append(
                f"{capitalise(names)} have similar signatures: after complete refits, these data "
                f"prefer the first, {format_probability(more)} to {format_probability(less)}."
            )
        else:
            sentences.append(f"These data hardly distinguish {names} (confounded causes).")
    return sentences


def _join_pairs(pairs: Sequence[tuple[str, str]]) -> list[set[str]]:
    """Return the connected components of a graph whose edges are these pairs."""
    components: list[set[str]] = []
    for pair in pairs:
        touched = [component for component in components if component.intersection(pair)]
        components = [component for component in components if component not in touched]
        components.append(set(pair).union(*touched))
    return components


def untested_sentences(verdict: Verdict, levels: int) -> list[str]:
    """Return sentences on effects that this kind of data cannot reveal, with reasons.

    Args:
        verdict: verdict with the effects that were not testable.
        levels: number of force levels of the hits.
    """
    sentences = []
    for effects, reason in _UNTESTED:
        why = _UNKNOWN_LEVELS if effects is LAW_EFFECTS and levels > 1 else reason
        nouns = [effect_noun(effect) for effect in verdict.not_testable if effect in effects]
        if nouns:
            sentences.append(f"Not tested, so not excluded: {_join_words(nouns)}; {why}.")
    return sentences


def sensor_check_sentences(shown: ShownFile) -> list[str]:
    """Return sentences on sensors that the data checks removed."""
    sentences = []
    for fault in shown.taken_out:
        if fault.effect == "sensor_swap":
            sentences.append(
                f"{capitalise(exchange_phrase(fault.location, fault.dof))}, as the channels prove "
                "without the model: exchange their cables or their labels. The search left these "
                "channels out."
            )
            continue
        channels = "channel" if fault.dof is not None and "+" not in fault.dof else "channels"
        towards = name_direction(fault.dof)
        towards = f" {towards}" if towards else ""
        text = place_name(fault.location)
        sentences.append(
            f"{capitalise(text)}{towards}: {effect_noun(fault.effect)}, proven without the "
            f"model; the search left the {channels} out."
        )
    return sentences


def format_probability(probability: float) -> str:
    """Return a probability in whole per cent, but never as 0 or 100 %."""
    if probability < 0.005:
        return "< 1 %"
    return "> 99 %" if probability > 0.995 else f"{100 * probability:.0f} %"


def _join_words(words: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
