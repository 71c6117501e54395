r"""A baseline: a latent force of a Gaussian process at each place, and laws that it may follow.

What a refit leaves of the test t is y_t = G_p f_t + noise, with the re-tuned model's FRFs G_p from
a place p to the channels. f is a Gaussian process over frequency, a sum of bumps

    f(w) = sum_m c_m exp(-(w - w_m)^2 / (2 l^2)),   c ~ CN(0, s^2),   l: distance of the w_m,

so that the evidence of p is closed: with the whitened columns X of all bumps, A = X^H X, b = X^H y,

    ln p(y) = const - sum ln(v) - |y|^2 - ln det(1 + s^2 A) + b^H (A + 1/s^2)^-1 b.

s, l and a relative error of the model are chosen by the evidence (empirical Bayes; Alvarez, Luengo,
Lawrence 2009 for latent forces). Places are wrenches on a body, pairs of wrenches on two bodies,
and factors over frequency of the channels of a sensor and of the force channel, which all tests
share. What stiffness and damping can follow to first order is taken off the residual before. At
each likely place one effect is named: of all laws with real sizes that which takes most of the
residual by least squares, stiffness and damping free beside it.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gapbench.baselines.effect_laws import (
    Field,
    channel_columns,
    effect_laws,
    moving_frfs,
    moving_labels,
    pair_response,
    respond_to_wrenches,
)
from gapbench.baselines.ranking import gap_probability
from gapbench.baselines.refit import CampaignRefit
from identification.words import Complex, Real
from mbmodel import WORLD, Evaluator, FrfRequest, parent_bodies

BUMPS = (6, 14)
STRENGTHS = 10.0 ** np.arange(-1.0, 4.5, 0.5)  # s of whitened columns of length 1 a value
MODEL_ERRORS = (0.0, 0.01, 0.03, 0.1)
TEMPERATURE = 20.0  # of the evidence [nats], which correlated model errors make too sure
NAMED_EFFECT = 0.6  # probability of the effect at its place
LEAST = 0.02  # probability from which a place is stated
STACK_ERROR = 0.003  # relative error of the model where laws are fitted
LINK_PRIOR = 0.5  # of a link, over that of a body, a joint, a sensor or the hammer
SIZES = {  # effects whose law has the size of the effect, less what no effect has
    "appendage": 0.0,
    "gyroscopic": 0.0,
    "hammer_delay": 0.0,
    "hammer_gain": 1.0,
    "inertance": 0.0,
    "mass_error": 0.0,
    "parallel_path": 0.0,
    "sensor_delay": 0.0,
    "sensor_gain": 1.0,
    "sensor_misalignment": 0.0,
    "stiffness": 0.0,
}
POSITIVE = ("appendage", "inertance", "mass_error")


def latent_force(fitted: CampaignRefit) -> dict[str, object]:
    """Return the answer of the latent force."""
    fields = [respond_to_wrenches(fitted, each) for each in fitted.tests]
    tuned = _tuned_directions(fitted, fields)
    left = _project([field.left for field in fields], fields, tuned)
    fields = _with_left(fields, left)
    places = list(_places(fitted, fields))
    evidence = np.array([_evidence(fields, columns, shared) for _, columns, shared in places])
    is_link = np.array([name.startswith("pair:") for name, *_ in places])
    evidence += TEMPERATURE * np.where(is_link, np.log(LINK_PRIOR), 0.0)
    missing = gap_probability(fitted.excess)
    weights = np.exp((evidence - evidence.max()) / TEMPERATURE)
    weights *= missing / weights.sum()
    sets: list[dict[str, Any]] = []
    gap: list[float] = []
    for number in np.argsort(-weights).tolist():
        if weights[number] < LEAST:
            break
        cause, taken = _name_effect(places[number][0], fitted, fields, (tuned, left))
        sets.append({"probability": NAMED_EFFECT * float(weights[number]), "causes": [cause]})
        gap = gap or [fitted.excess, fitted.excess * float(np.sqrt(max(1 - taken, 0.0)))]
    rest = max(0.0, missing - sum(entry["probability"] for entry in sets))
    answer: dict[str, object] = {"none": 1 - missing, "unexplained": rest, "sets": sets}
    return answer | ({"gap": gap} if gap else {})


def _tuned_directions(fitted: CampaignRefit, fields: list[Field]) -> Real:
    """Return an orthonormal basis of what stiffness and damping change, with rows of their priors.

    Tolerances stay where the refit put them: a fault must not hide far outside of them.
    """
    varies, model = fitted.session.parametrisation, fitted.session.model
    rates = varies.rates(varies.coordinates(fitted.theta))
    blocks = []
    for field in fields:
        test = field.residual.test
        labels = moving_labels(field.residual)
        request = FrfRequest(
            test.estimate.frf.freq_hz,
            tuple(label.positive for label in labels),
            (test.condition.reference.positive,),
        )
        slopes = Evaluator(model, request, condition=test.condition).at(fitted.theta).columns()
        signs = np.array([label.sign * test.condition.reference.sign for label in labels], float)
        by_parameter = slopes[:, :, 0] * signs[:, None] * rates
        columns = np.zeros((*by_parameter.shape[:2], varies.size), complex)
        for number in np.flatnonzero(varies.free).tolist():
            columns[:, :, varies.coordinate_of[number]] += by_parameter[:, :, number]
        blocks.append(columns)
    springs = np.flatnonzero(~varies.is_tolerance)
    stacked = np.stack(
        [_stack([block[:, :, k] for block in blocks], fields) for k in springs], axis=1
    )
    prior = np.diag(np.sqrt(np.maximum(varies.precision[springs], 1e-6)))
    return np.asarray(np.linalg.qr(np.vstack([stacked, prior]))[0])


def _project(values: list[Complex], fields: list[Field], tuned: Real) -> Real:
    """Return stacked values less what the tuned parameters follow, with the pulls that it costs."""
    stacked = _stack(values, fields)
    padded = np.concatenate([stacked, np.zeros(len(tuned) - len(stacked))])
    return np.asarray(padded - tuned @ (tuned.T @ padded))


def _with_left(fields: list[Field], left: Real) -> list[Field]:
    """Return the fields with a stacked residual instead of their own."""
    sizes = [field.left.size for field in fields]
    total = sum(sizes)
    white = left[:total] + 1j * left[total : 2 * total]
    parts = np.split(white, np.cumsum(sizes)[:-1])
    return [
        replace(field, left=part.reshape(field.left.shape) * np.sqrt(_variance(field, STACK_ERROR)))
        for field, part in zip(fields, parts, strict=True)
    ]


def _places(
    fitted: CampaignRefit, fields: list[Field]
) -> Iterator[tuple[str, list[Complex], bool]]:
    """Yield each place, its columns for every test, and whether all tests share the process."""
    machine, layout = fitted.session.model.machine, fitted.session.campaign.layout
    parents = {body: under or WORLD for body, under in parent_bodies(machine).items()}
    for body in layout.bodies:
        yield f"body:{body}", [field.from_body[body] for field in fields], False
    for number, upper in enumerate(layout.bodies):
        for lower in (WORLD, *layout.bodies[:number]):
            name = f"joint:{upper}" if parents[upper] == lower else f"pair:{lower}-{upper}"
            yield name, [pair_response(fitted, field, lower, upper) for field in fields], False
    for site in dict.fromkeys(label.point for label in moving_labels(fields[0].residual)):
        yield f"sensor:{site}", [channel_columns(field, site) for field in fields], True
    reference = fields[0].residual.test.condition.reference
    yield f"hammer:{reference.point}", [moving_frfs(field)[:, :, None] for field in fields], True


def _variance(field: Field, error: float) -> Real:
    moves = field.residual.moves
    values = np.abs(field.residual.model + field.residual.left)[:, moves] ** 2
    mean = np.maximum(field.residual.variance[:, moves], 1e-12 * values.mean())
    return np.asarray(mean + error**2 * values)


def _noise_evidence(fields: list[Field], error: float) -> float:
    """Return the evidence that nothing but noise and an error of the model is left."""
    total = 0.0
    for field in fields:
        variance, left = _variance(field, error), field.left
        total -= float(np.log(variance).sum() + (np.abs(left) ** 2 / variance).sum())
    return total


def _evidence(fields: list[Field], columns: list[Complex], shared: bool) -> float:
    """Return the evidence of a place, at the best strength, smoothness and error of the model."""
    best = -np.inf
    for error in MODEL_ERRORS:
        base = _noise_evidence(fields, error)
        for count in BUMPS:
            normals = [
                _normal(field, each, error, count)
                for field, each in zip(fields, columns, strict=True)
            ]
            if shared:
                normals = [tuple(np.sum(parts, axis=0) for parts in zip(*normals, strict=True))]
            gains = np.zeros(len(STRENGTHS))
            for matrix, right in normals:
                values, vectors = np.linalg.eigh(matrix)
                power = np.abs(vectors.conj().T @ right) ** 2
                grown = 1 + STRENGTHS[:, None] ** 2 * np.maximum(values, 0.0)
                gains += (STRENGTHS[:, None] ** 2 * power / grown - np.log(grown)).sum(axis=1)
            best = max(best, base + float(gains.max()))
    return best


def _normal(field: Field, columns: Complex, error: float, count: int) -> tuple[Complex, Complex]:
    """Return A and b of whitened columns times bumps over frequency."""
    spread = np.sqrt(_variance(field, error))
    white = columns / spread[:, :, None]
    left = field.left / spread
    scale = np.sqrt((np.abs(white) ** 2).mean(axis=(0, 1)))
    white = white / np.where(scale > 0, scale, 1.0) / np.sqrt(white.shape[0] * white.shape[1])
    centres = np.linspace(field.omega[0], field.omega[-1], count)
    bumps = np.exp(-0.5 * ((field.omega[:, None] - centres) / (centres[1] - centres[0])) ** 2)
    gram = np.einsum("foi,foj->fij", white.conj(), white)
    matrix = np.einsum("fm,fn,fij->minj", bumps, bumps, gram, optimize=True)
    right = np.einsum("fm,foi,fo->mi", bumps, white.conj(), left, optimize=True)
    size = count * columns.shape[2]
    return matrix.reshape(size, size), right.reshape(size)


def _name_effect(
    place: str, fitted: CampaignRefit, fields: list[Field], tuned: tuple[Real, Real]
) -> tuple[dict[str, Any], float]:
    """Return the effect whose law takes most of the residual, and the share that it takes."""
    directions, left = tuned
    best: dict[str, Any] = {"effect": "flexible_body", "places": [place]}
    share = 0.0
    for effect, columns in effect_laws(place, fitted, fields):
        matrix = np.stack([_project(column, fields, directions) for column in columns], axis=1)
        sizes = np.linalg.lstsq(matrix, left, rcond=None)[0]
        if effect in POSITIVE and sizes[0] < 0:
            continue
        taken = 1 - float(np.sum((left - matrix @ sizes) ** 2) / np.sum(left**2))
        if taken > share:
            best, share = {"effect": effect, "places": [place]}, taken
            if effect in SIZES:
                size = float(np.linalg.norm(sizes)) if len(sizes) > 1 else float(sizes[0])
                best["size"] = size + SIZES[effect]
    return best, share


def _stack(values: list[Complex], fields: list[Field]) -> Real:
    """Return values of all tests over their noise, real parts above imaginary ones."""
    white = [
        (value / np.sqrt(_variance(field, STACK_ERROR))).ravel()
        for value, field in zip(values, fields, strict=True)
    ]
    joined = np.concatenate(white)
    return np.concatenate([joined.real, joined.imag])
