"""Modal misfit: frequencies, damping ratios and shapes of paired modes.

    J = 1/N [sum_r c(r, q_r) + sum over unpaired e / 2 a^2]
    c(r, q) = 1/2 [log^2(w_q / w_r) / (sd_w^2 + a^2) + log^2(zeta_q / zeta_r) / (sd_z^2 + b^2)
                   + (1 - MAC(phi_r, y_q)) / a^2],     y_q = L T phi_q

r runs over the N measured modes, q_r is the model's mode that is paired with it. MAC is the modal
assurance criterion (Allemang and Brown 1982), sd are relative standard deviations of the measured
values, a and b model-error floors. Poles are s = w (-zeta + i sqrt(1 - zeta^2)), with time
convention exp(+i w t) (seed, eq. 3.4).

Modes are paired one to one with the least sum of c (assignment problem, Kuhn 1955 and Munkres
1957). A search decides at its start which measured modes have a partner at all. The partner itself
is chosen anew at every theta, so that the cost stays continuous if two modes of the model change
order. An unpaired mode costs as much as the worst admissible pair, so that losing a mode never
pays. A first stage, in which damping hardly counts and every mode does, finds the minimum from far
away; searches that count damping ratios from the start end in other minima.

Modes say little about some parameters. Within a search each size therefore has a wide prior about
its starting value, log^2(theta / theta_0) / (2 N 3^2). It keeps parameters on which no mode depends
away from their bounds.
"""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from identification.modal import identify, mac
from identification.words import (
    Campaign,
    Complex,
    HasPoles,
    InputError,
    Integers,
    Mask,
    ModalModel,
    Real,
    UsageError,
)
from mbmodel import LinearisedModes, ModeEvaluator, Model, Modes

_START_PRIOR_SD = 3.0  # of a size's logarithm about the start of a search
_MIN_SHAPE_RATIO = 1e-10  # of the largest motion: below it a channel does not move
_MIN_DAMPING_RATIO = 1e-9  # a lower measured ratio has no usable logarithm


@dataclass(frozen=True)
class ModalStage:
    """One minimisation of the modal misfit.

    Args:
        model_error_floor: a, relative error of frequencies and shapes that the fit tolerates.
        damping: b, relative error of damping ratios that the fit tolerates.
        edge: e, twice the cost times a^2 beyond which two modes are no pair. At 0.6 this is a MAC
            of 0.4 at equal frequencies, or a factor of 2.2 in frequency at equal shapes.
    """

    model_error_floor: float
    damping: float
    edge: float = 0.6


MODAL_STAGES = (ModalStage(0.1, 5.0, 2.0), ModalStage(0.03, 0.15))


@dataclass(frozen=True, eq=False)
class ModePairs(HasPoles):
    """Pairs of measured modes and modes of the model.

    Args:
        partner: index of each measured mode's partner, -1 for none; (n_measured,).
        mac: MAC of each pair, zero without a partner; (n_measured,).
        poles: poles of the model's modes that oscillate, by rising frequency [rad/s]; (n_model,).
        cost: J of these pairs.
    """

    partner: Integers
    mac: Real
    poles: Complex
    cost: float


def modes_in_band(campaign: Campaign) -> ModalModel:
    """Identify a campaign's modes inside the band, with shapes at the measured channels.

    Tests with models or poses of their own have other modes, and are left out.

    For a roving hammer the shapes are those at the points that were hit, by reciprocity.

    Raises:
        InputError: tests that cannot be combined, or no FRF with a known variance.
    """
    if "" not in campaign.variants:
        raise InputError(
            f"{campaign.name}: all tests have models or poses of their own, but modes are fitted "
            "to the machine of the campaign: tune with --residual log"
        )
    model, identified, measured = identify(campaign.select_variant(""))
    inside = np.arange(len(model.poles)) < identified.inside.sum()
    was_measured = np.asarray(measured.measured.any(axis=1), np.bool_)
    return select_modes(model, inside, was_measured)


def select_modes(model: ModalModel, modes: Mask, outputs: Mask) -> ModalModel:
    """Return a modal model with some of its modes and outputs.

    Args:
        modes: whether each mode is kept; (n_mode,).
        outputs: whether each output is kept; (n_out,).
    """
    rows = np.flatnonzero(outputs)
    return replace(
        model,
        poles=model.poles[modes],
        shapes=model.shapes[np.ix_(rows, np.flatnonzero(modes))],
        participation=model.participation[:, modes],
        lower=model.lower[rows],
        upper=model.upper[rows],
        outputs=tuple(model.outputs[row] for row in rows),
        freq_sd=model.freq_sd[modes],
        damping_sd=model.damping_sd[modes],
    )


class ModalCost:
    """Cost J of modes as a function of theta, with its exact gradient.

    Shapes are compared at channels that move in the model. If translations and rotations were
    measured, only translations count.

    Args:
        measured: measured modes that count, all inside the band.
        stage: model-error floors and the limit of pairing.

    Attributes:
        outputs: channels at which shapes are compared.

    Raises:
        UsageError: no measured mode, or an output that the machine does not have.
    """

    def __init__(self, model: Model, measured: ModalModel, stage: ModalStage) -> None:
        if not len(measured.poles):
            raise UsageError("no mode was measured in the band: leave the modal residual out")
        everywhere = ModeEvaluator(model, measured.outputs)
        moving = _moving_channels(everywhere.at(model.drawn), measured)
        self.outputs = tuple(measured.outputs[k] for k in moving)
        self._evaluator = ModeEvaluator(model, self.outputs)
        self._measured, self._shapes = measured, measured.shapes[moving]
        self._is_counted = np.ones(len(measured.poles), bool)
        self._sizes = np.array([parameter.positive for parameter in model.parameters], bool)
        self._start: Real | None = None
        ratio = np.maximum(measured.damping, _MIN_DAMPING_RATIO)
        self._log_freq, self._log_damping = np.log(np.abs(measured.poles)), np.log(ratio)
        self._freq_weight = 1 / (
            (measured.freq_sd / measured.freq_hz) ** 2 + stage.model_error_floor**2
        )
        self._damping_weight = 1 / ((measured.damping_sd / ratio) ** 2 + stage.damping**2)
        self._damping_weight[measured.damping <= _MIN_DAMPING_RATIO] = 0.0
        self._shape_weight = 1 / stage.model_error_floor**2
        self._unpaired_cost = 0.5 * stage.edge * self._shape_weight

    def start_at(self, theta: Real) -> "ModalCost":
        """Return the cost of a search from theta: modes unpaired there no longer count."""
        started = copy(self)
        started._is_counted, started._start = self.pairs(theta).partner >= 0, theta[self._sizes]
        return started

    def pairs(self, theta: Real) -> ModePairs:
        """Pair measured modes and modes of the model at theta."""
        linearised = self._evaluator.at(theta)
        return self.pair_modes(linearised.modes, linearised.shapes)

    def pair_modes(self, modes: Modes, shapes: Complex) -> ModePairs:
        """Pair measured modes and modes of the model.

        Args:
            shapes: their motion at ``outputs``; (n_out, n_mode).
        """
        oscillating, cost, mac_matrix = self._compare(modes, shapes)
        rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(cost, self._unpaired_cost))
        is_pair = cost[rows, columns] < self._unpaired_cost
        rows, columns = rows[is_pair], columns[is_pair]
        partner, pair_mac = np.full(len(cost), -1), np.zeros(len(cost))
        partner[rows], pair_mac[rows] = columns, mac_matrix[rows, columns]
        total = cost[rows, columns].sum() + (len(cost) - len(rows)) * self._unpaired_cost
        return ModePairs(partner, pair_mac, modes.poles[oscillating], float(total) / len(cost))

    def __call__(self, theta: Real) -> tuple[float, Real]:
        """Return J and dJ / dtheta [1/SI]; (n_parameter,)."""
        linearised = self._evaluator.at(theta)
        oscillating, cost, _ = self._compare(linearised.modes, linearised.shapes)
        counted = np.flatnonzero(self._is_counted)
        rows, columns = scipy.optimize.linear_sum_assignment(cost[counted])
        rows, partners = counted[rows], oscillating[columns]
        count = len(self._is_counted)
        total = cost[rows, columns].sum() + (count - len(rows)) * self._unpaired_cost
        pole_slopes = self._pole_slopes(rows, linearised.modes.poles[partners])
        shape_slopes = self._shape_slopes(rows, linearised.shapes[:, partners])
        gradient = linearised.gradient(partners, pole_slopes, shape_slopes)
        if self._start is not None:
            pull = np.log(theta[self._sizes] / self._start) / _START_PRIOR_SD**2
            total += 0.5 * _START_PRIOR_SD**2 * (pull**2).sum()
            gradient[self._sizes] += pull / theta[self._sizes]
        return float(total) / count, gradient / count

    def _compare(self, modes: Modes, shapes: Complex) -> tuple[Integers, Real, Real]:
        """Compare each measured mode with each mode of the model that oscillates.

        Returns:
            Indices of the model's modes (n_model,), c and MAC (n_measured, n_model) each.
        """
        oscillating = np.flatnonzero((modes.poles.imag > 0) & (modes.poles.real < 0))
        mac_matrix = mac(self._shapes, shapes[:, oscillating])
        freq_log_ratio = np.log(np.abs(modes.poles[oscillating])) - self._log_freq[:, None]
        damping_log_ratio = np.log(modes.damping[oscillating]) - self._log_damping[:, None]
        squares = (
            freq_log_ratio**2 * self._freq_weight[:, None]
            + damping_log_ratio**2 * self._damping_weight[:, None]
        )
        cost: Real = 0.5 * (squares + (1 - mac_matrix) * self._shape_weight)
        return oscillating, cost, mac_matrix

    def _pole_slopes(self, rows: Integers, poles: Complex) -> Complex:
        """Return h of dc = Re conj(h) ds.

        It follows from d log w = Re ds / s and d log zeta = Re (1 / Re s - 1 / s) ds.

        Args:
            rows: measured modes; (n,).
            poles: poles of their partners; (n,).
        """
        freq_log_ratio = np.log(np.abs(poles)) - self._log_freq[rows]
        damping_log_ratio = np.log(-poles.real / np.abs(poles)) - self._log_damping[rows]
        by_freq, by_damping = (
            freq_log_ratio * self._freq_weight[rows],
            damping_log_ratio * self._damping_weight[rows],
        )
        slopes: Complex = by_freq / poles + by_damping * (1 / poles.real - 1 / poles)
        return slopes.conj()

    def _shape_slopes(self, rows: Integers, shapes: Complex) -> Complex:
        """Return W of dc = Re conj(W) dy, for MAC = |m^H y|^2 / (m^H m y^H y); (n_out, n)."""
        measured = self._shapes[:, rows]
        product = (measured.conj() * shapes).sum(axis=0)
        size, square = ((np.abs(shape) ** 2).sum(axis=0) for shape in (measured, shapes))
        is_visible = size * square > 0  # a mode that no channel sees has MAC 0 and no slope
        norm = np.where(is_visible, size * square, 1.0)
        share = np.abs(product) ** 2 / (norm * np.where(is_visible, square, 1.0))
        return (share * shapes - measured * (product / norm)) * self._shape_weight


def _moving_channels(linearised: LinearisedModes, measured: ModalModel) -> Integers:
    """Return the channels of one kind that move in the model at any stiffness and damping."""
    size = np.abs(linearised.shapes).max(axis=1, initial=0.0)
    rotation = np.array([dof.is_rotation for dof in measured.outputs], bool)
    kind = rotation if rotation.all() else ~rotation
    return np.flatnonzero(kind & (size > _MIN_SHAPE_RATIO * size[kind].max(initial=0.0)))
