"""Responses of a re-tuned model to wrenches, and the laws of effects as columns of responses."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gapbench.baselines.refit import CampaignRefit, TestResidual
from identification.words import Complex, Dof, Real
from mbmodel import WORLD, FrfRequest, linearise, parent_bodies

_BODY_AXES = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Field:
    """Responses and motions of a test.

    Args:
        residual: of the test.
        left: residual of the moving channels; (n_freq, n_moving).
        omega: [rad/s]; (n_freq,).
        from_body: response of the moving channels to the six wrenches on each body;
            (n_freq, n_moving, 6).
        motion: acceleration of each body's centre of mass in the test, that of the model corrected
            by the sensors on the body; (n_freq, 6).
    """

    residual: TestResidual
    left: Complex
    omega: Real
    from_body: dict[str, Complex]
    motion: dict[str, Complex]


def respond_to_wrenches(fitted: CampaignRefit, residual: TestResidual) -> Field:
    """Return responses to wrenches on all bodies, and the motion of these."""
    model, frf = fitted.session.model, residual.test.estimate.frf
    bodies = fitted.session.campaign.layout.bodies
    wrenches = tuple(Dof(body, f"+{axis}") for body in bodies for axis in _BODY_AXES)
    outputs = moving_labels(residual)
    plus = tuple(label.positive for label in outputs)
    reference = residual.test.condition.reference
    request = FrfRequest(frf.freq_hz, (*plus, *wrenches), (*wrenches, reference.positive))
    values = linearise(model, fitted.theta, request).values
    signs = np.array([label.sign for label in outputs], float)
    response = values[:, : len(plus), :-1] * signs[:, None]
    motion = values[:, len(plus) :, -1] * reference.sign
    measured = frf.values[:, residual.moves, 0]
    off = measured - values[:, : len(plus), -1] * signs * reference.sign
    motions = {}
    for k, body in enumerate(bodies):
        rows = [i for i, label in enumerate(plus) if _body_of(fitted, label.point) == body]
        reading = np.array([_reading(fitted, outputs[i]) for i in rows]).reshape(-1, 6)
        motions[body] = (
            motion[:, 6 * k : 6 * k + 6] + off[:, rows] @ np.linalg.pinv(reading, 0.01).T
        )
    return Field(
        residual,
        residual.left[:, residual.moves],
        2 * np.pi * np.asarray(frf.freq_hz),
        {body: response[:, :, 6 * k : 6 * k + 6] for k, body in enumerate(bodies)},
        motions,
    )


def _body_of(fitted: CampaignRefit, site: str) -> str:
    layout = fitted.session.campaign.layout
    return str(layout.bodies[layout.body_of[layout.points.index(site)]])


def _reading(fitted: CampaignRefit, label: Dof) -> Real:
    """Return what a channel reads of the motion of its body's centre of mass; (6,)."""
    layout = fitted.session.campaign.layout
    point = layout.points.index(label.point)
    axis = label.sign * layout.axes[point][:, "xyz".index(label.direction[-1])]
    arm = layout.positions[point] - layout.centres[layout.body_of[point]]
    return np.concatenate([axis, np.cross(arm, axis)])


def moving_labels(residual: TestResidual) -> list[Dof]:
    """Return the labels of the channels that move."""
    outputs = residual.test.estimate.frf.outputs
    pairs = zip(outputs, residual.moves, strict=True)
    return [label for label, moves in pairs if moves and isinstance(label, Dof)]


def moving_frfs(field: Field) -> Complex:
    """Return the FRFs of the model at the channels that move; (n_freq, n_moving)."""
    return field.residual.model[:, field.residual.moves]


def channel_columns(field: Field, site: str) -> Complex:
    """Return what factors and cross-talk of a sensor's channels add; (n_freq, n_moving, k^2)."""
    rows = [k for k, label in enumerate(moving_labels(field.residual)) if label.point == site]
    values = moving_frfs(field)
    columns = np.zeros((*values.shape, len(rows) ** 2), complex)
    for i, row in enumerate(rows):
        for k, source in enumerate(rows):
            columns[:, row, i * len(rows) + k] = values[:, source]
    return columns


def _transport(fitted: CampaignRefit, body: str, point: Real) -> Real:
    """Return the motion of a point per motion of a body's centre of mass; (6, 6)."""
    layout = fitted.session.campaign.layout
    arm = point - layout.centres[layout.bodies.index(body)]
    across = np.array([[0, arm[2], -arm[1]], [-arm[2], 0, arm[0]], [arm[1], -arm[0], 0]])
    return np.block([[np.eye(3), across], [np.zeros((3, 3)), np.eye(3)]])


def _middle(fitted: CampaignRefit, lower: str, upper: str) -> Real:
    """Return the point between two centres of mass; that of the upper body above the ground."""
    layout = fitted.session.campaign.layout
    names = [name for name in (lower, upper) if name != WORLD]
    return np.asarray(
        np.mean([layout.centres[layout.bodies.index(name)] for name in names], axis=0)
    )


def pair_response(fitted: CampaignRefit, field: Field, lower: str, upper: str) -> Complex:
    """Return the response to a wrench on a body and its opposite on another."""
    point = _middle(fitted, lower, upper)
    columns = field.from_body[upper] @ _transport(fitted, upper, point).T
    if lower != WORLD:
        columns = columns - field.from_body[lower] @ _transport(fitted, lower, point).T
    return columns


def _pair_motion(fitted: CampaignRefit, field: Field, lower: str, upper: str) -> Complex:
    """Return the relative displacement at the point between two bodies; (n_freq, 6)."""
    point = _middle(fitted, lower, upper)
    motion = field.motion[upper] @ _transport(fitted, upper, point).T
    if lower != WORLD:
        motion = motion - field.motion[lower] @ _transport(fitted, lower, point).T
    return np.asarray(-motion / np.maximum(field.omega, 1e-3)[:, None] ** 2)


Laws = Iterator[tuple[str, list[list[Complex]]]]  # effects, each with its responses


def effect_laws(place: str, fitted: CampaignRefit, fields: list[Field]) -> Laws:
    """Return each effect that can sit at a place with the responses to its sizes."""
    kind, _, name = place.partition(":")
    if kind == "hammer":
        return _force_laws(fields)
    if kind == "sensor":
        return _sensor_laws(name, fields)
    if kind == "body":
        return _body_laws(name, fields)
    return _joint_laws(kind, name, fitted, fields)


def _force_laws(fields: list[Field]) -> Laws:
    yield "hammer_gain", [[moving_frfs(f) for f in fields]]
    yield "hammer_delay", [[-1j * f.omega[:, None] * moving_frfs(f) for f in fields]]


def _sensor_laws(site: str, fields: list[Field]) -> Laws:
    channels = [channel_columns(field, site) for field in fields]
    n = int(np.sqrt(channels[0].shape[2]))
    for k in range(n):
        yield "sensor_gain", [[c[:, :, k * (n + 1)] for c in channels]]
    direct = [c[:, :, :: n + 1].sum(axis=2) for c in channels]
    yield (
        "sensor_delay",
        [[-1j * f.omega[:, None] * c for f, c in zip(fields, direct, strict=True)]],
    )
    turns = [(i, k) for i in range(n) for k in range(i)]
    if turns:
        across = [[c[:, :, i * n + k] - c[:, :, k * n + i] for c in channels] for i, k in turns]
        yield "sensor_misalignment", across


def _body_laws(body: str, fields: list[Field]) -> Laws:
    forces = [
        [-f.from_body[body][:, :, k] * f.motion[body][:, k, None] for f in fields] for k in range(3)
    ]
    yield "mass_error", [[np.sum(parts, axis=0) for parts in zip(*forces, strict=True)]]
    highest = fields[0].omega[-1]
    for resonance in np.geomspace(max(fields[0].omega[0], 0.1 * highest), highest, 24):
        for force in forces:
            lagging = []
            for field, value in zip(fields, force, strict=True):
                spring = resonance**2 + 0.04j * resonance * field.omega
                lagging.append(value * (spring / (spring - field.omega**2))[:, None])
            yield "appendage", [lagging]
    turning = []
    for k in range(3):
        i, j = 3 + (k + 1) % 3, 3 + (k + 2) % 3
        turning.append(
            [
                (
                    f.from_body[body][:, :, j] * f.motion[body][:, i, None]
                    - f.from_body[body][:, :, i] * f.motion[body][:, j, None]
                )
                / (1j * np.maximum(f.omega, 1e-3))[:, None]
                for f in fields
            ]
        )
    yield "gyroscopic", turning


def _joint_laws(kind: str, name: str, fitted: CampaignRefit, fields: list[Field]) -> Laws:
    machine = fitted.session.model.machine
    parents = {body: under or WORLD for body, under in parent_bodies(machine).items()}
    lower, upper = (parents[name], name) if kind == "joint" else _bodies_of(name, parents)
    springs = [
        (pair_response(fitted, f, lower, upper), _pair_motion(fitted, f, lower, upper))
        for f in fields
    ]
    axes = [[-g[:, :, k] * x[:, k, None] for g, x in springs] for k in range(6)]
    if kind == "pair":
        yield "parallel_path", axes[:3]
        return
    if fitted.session.campaign.has_states:
        for axis in axes:
            yield "stiffness", [axis]
    yield "structural_damping", [[1j * value for value in axis] for axis in axes]
    for axis in axes:
        squares = [-(f.omega[:, None] ** 2) * v for f, v in zip(fields, axis, strict=True)]
        yield "inertance", [squares]
    for corner in np.geomspace(20.0, 2000.0, 5):
        relaxing = [1j * f.omega / (1j * f.omega + corner) for f in fields]
        yield (
            "viscoelastic",
            [[h[:, None] * v for h, v in zip(relaxing, axis, strict=True)] for axis in axes],
        )
    coupled = [
        [-g[:, :, i] * x[:, k, None] - g[:, :, k] * x[:, i, None] for g, x in springs]
        for i in range(3)
        for k in range(3, 6)
    ]
    yield "joint_coupling", coupled


def _bodies_of(pair: str, parents: dict[str, str]) -> tuple[str, str]:
    """Return the two bodies of a pair, whose names may have hyphens."""
    for upper in parents:
        if pair.endswith(f"-{upper}") and pair.removesuffix(f"-{upper}") in {WORLD, *parents}:
            return pair.removesuffix(f"-{upper}"), upper
    raise ValueError(pair)
