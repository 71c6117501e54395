r"""The modal residual: frequencies, damping ratios and shapes of paired modes.

    J = 1/N [sum_r c(r, q_r) + sum over unpaired e / 2 a^2]
    c(r, q) = 1/2 [log^2(w_q / w_r) / (sd_w^2 + a^2) + log^2(zeta_q / zeta_r) / (sd_z^2 + b^2)
                   + (1 - MAC(phi_r, y_q)) / a^2],     y_q = L T phi_q

r runs over the N measured modes, q_r is the mode of the model that belongs to it, sd are relative
standard deviations of what was measured, a and b allowances: errors that the model may have
anyway. Poles s = w (-zeta + i sqrt(1 - zeta^2)), time convention exp(+i w t) (seed, eq. 3.4).

Modes are paired one to one with the least sum of c (Kuhn and Munkres). Which measured modes have a
partner at all is decided where a search begins and kept within it; who the partner is follows
from the least sum again at every theta, so that the cost stays continuous where modes of the
model pass each other. Losing a mode costs what a pair at the edge of belonging costs: it never
pays. A first stage in which damping hardly counts and every mode does finds the minimum from far
off; with damping ratios counted from the beginning, searches end in other minima.

Modes tell little of some parameters. Within a search each size is therefore held, loosely, where
the search began: log^2(theta / theta_0) / (2 N 3^2) is added, so that what no mode sees does not
run to its bound.
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
    Integers,
    Mask,
    ModalModel,
    Real,
    UsageError,
)
from mbmodel import LinearisedModes, ModeEvaluator, Model

_UNSEEN = 3.0  # standard deviation of a size's logarithm around where a search begins
_STILL = 1e-10  # share of the largest motion below which a channel does not move
_UNDAMPED = 1e-9  # measured ratio below which there is no logarithm to compare


@dataclass(frozen=True)
class ModalStage:
    """One minimisation of the modal residual.

    Args:
        allowance: a, relative error of frequencies and shapes that the model may have anyway.
        damping: b, the same of damping ratios.
        edge: e, twice the cost times a^2 beyond which two modes are no pair: 0.6 is a MAC of 0.4
            at the same frequency, or frequencies a factor of 2.2 apart with the same shape.
    """

    allowance: float
    damping: float
    edge: float = 0.6


MODAL_STAGES = (ModalStage(0.1, 5.0, 2.0), ModalStage(0.03, 0.15))


@dataclass(frozen=True, eq=False)
class Pairs(HasPoles):
    """The modes of a model that belong to the measured ones.

    Args:
        partner: number of each measured mode's partner, -1 for none; (n_measured,).
        mac: of the pairs, zero where there is none; (n_measured,).
        poles: of the model's modes that oscillate, by rising frequency [rad/s]; (n_model,).
        cost: J of these pairs.
    """

    partner: Integers
    mac: Real
    poles: Complex
    cost: float


def modes_in_band(campaign: Campaign) -> ModalModel:
    """Identify a campaign's modes inside the band, shapes at the channels that were measured.

    Of a roving hammer the shapes are those at the points that were hit, by reciprocity.

    Raises:
        InputError: tests that cannot stand side by side, no cell with a known variance.
    """
    model, found, measured = identify(campaign)
    inside = np.arange(len(model.poles)) < found.inside.sum()
    seen = np.asarray(measured.measured.any(axis=1), np.bool_)
    return some_modes(model, inside, seen)


def some_modes(model: ModalModel, modes: Mask, outputs: Mask) -> ModalModel:
    """The part of a modal model with some modes and outputs.

    Args:
        model: the whole.
        modes: which to keep; (n_mode,).
        outputs: likewise; (n_out,).
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
    """The cost J of modes as a function of theta, with its exact gradient.

    Shapes are compared at channels that move in the model at all, translations alone where
    rotations were measured beside them.

    Args:
        model: machine and Parts.
        measured: the modes that count, all inside the band.
        stage: allowances, and when modes are no pair.

    Raises:
        UsageError: no mode, an output that the machine does not have.
    """

    def __init__(self, model: Model, measured: ModalModel, stage: ModalStage) -> None:
        if not len(measured.poles):
            raise UsageError("no mode was measured in the band: leave the modal residual out")
        everywhere = ModeEvaluator(model, measured.outputs)
        moving = _moving(everywhere.at(model.drawn), measured)
        self._evaluator = ModeEvaluator(model, [measured.outputs[k] for k in moving])
        self._measured, self._shapes = measured, measured.shapes[moving]
        self._counts = np.ones(len(measured.poles), bool)
        self._sizes = np.array([parameter.positive for parameter in model.parameters], bool)
        self._start: Real | None = None
        ratio = np.maximum(measured.damping, _UNDAMPED)
        self._log_freq, self._log_damping = np.log(np.abs(measured.poles)), np.log(ratio)
        self._by_freq = 1 / ((measured.freq_sd / measured.freq_hz) ** 2 + stage.allowance**2)
        self._by_damping = 1 / ((measured.damping_sd / ratio) ** 2 + stage.damping**2)
        self._by_damping[measured.damping <= _UNDAMPED] = 0.0
        self._by_shape = 1 / stage.allowance**2
        self._lost = 0.5 * stage.edge * self._by_shape

    def begin(self, theta: Real) -> "ModalCost":
        """The same cost, where modes without a partner at theta do not count any more."""
        begun = copy(self)
        begun._counts, begun._start = self.pairs(theta).partner >= 0, theta[self._sizes]
        return begun

    def pairs(self, theta: Real) -> Pairs:
        """Who belongs to whom at theta."""
        now = self._evaluator.at(theta)
        chosen, cost, criterion = self._compare(now)
        rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(cost, self._lost))
        belongs = cost[rows, columns] < self._lost
        rows, columns = rows[belongs], columns[belongs]
        partner, own = np.full(len(cost), -1), np.zeros(len(cost))
        partner[rows], own[rows] = columns, criterion[rows, columns]
        total = cost[rows, columns].sum() + (len(cost) - len(rows)) * self._lost
        return Pairs(partner, own, now.found.poles[chosen], float(total) / len(cost))

    def __call__(self, theta: Real) -> tuple[float, Real]:
        """J and dJ / dtheta in SI; (n_parameter,)."""
        now = self._evaluator.at(theta)
        chosen, cost, _ = self._compare(now)
        counted = np.flatnonzero(self._counts)
        rows, columns = scipy.optimize.linear_sum_assignment(cost[counted])
        rows, partners = counted[rows], chosen[columns]
        count = len(self._counts)
        total = cost[rows, columns].sum() + (count - len(rows)) * self._lost
        by_poles = self._pole_slopes(rows, now.found.poles[partners])
        by_shapes = self._shape_slopes(rows, now.shapes[:, partners])
        gradient = now.gradient(partners, by_poles, by_shapes)
        if self._start is not None:
            factor = np.log(theta[self._sizes] / self._start) / _UNSEEN**2
            total += 0.5 * _UNSEEN**2 * (factor**2).sum()
            gradient[self._sizes] += factor / theta[self._sizes]
        return float(total) / count, gradient / count

    def _compare(self, now: LinearisedModes) -> tuple[Integers, Real, Real]:
        """The model's modes that oscillate; c and MAC of each with each measured one."""
        found = now.found
        chosen = np.flatnonzero((found.poles.imag > 0) & (found.poles.real < 0))
        criterion = mac(self._shapes, now.shapes[:, chosen])
        ratio = np.log(np.abs(found.poles[chosen])) - self._log_freq[:, None]
        losses = np.log(found.damping[chosen]) - self._log_damping[:, None]
        squares = ratio**2 * self._by_freq[:, None] + losses**2 * self._by_damping[:, None]
        cost: Real = 0.5 * (squares + (1 - criterion) * self._by_shape)
        return chosen, cost, criterion

    def _pole_slopes(self, rows: Integers, poles: Complex) -> Complex:
        """The h of dc = Re conj(h) ds; d log w = Re ds / s, d log zeta = Re (1 / Re s - 1 / s) ds.

        Args:
            rows: measured modes; (n,).
            poles: of their partners; (n,).
        """
        ratio = np.log(np.abs(poles)) - self._log_freq[rows]
        losses = np.log(-poles.real / np.abs(poles)) - self._log_damping[rows]
        by_ratio, by_losses = ratio * self._by_freq[rows], losses * self._by_damping[rows]
        slopes: Complex = by_ratio / poles + by_losses * (1 / poles.real - 1 / poles)
        return slopes.conj()

    def _shape_slopes(self, rows: Integers, shapes: Complex) -> Complex:
        """The W of dc = Re conj(W) dy, for MAC = |m^H y|^2 / (m^H m y^H y); (n_out, n)."""
        own = self._shapes[:, rows]
        product = (own.conj() * shapes).sum(axis=0)
        size, square = ((np.abs(part) ** 2).sum(axis=0) for part in (own, shapes))
        seen = size * square > 0  # a mode that no channel sees has MAC 0 and no slope
        whole = np.where(seen, size * square, 1.0)
        share = np.abs(product) ** 2 / (whole * np.where(seen, square, 1.0))
        slopes: Complex = (share * shapes - own * (product / whole)) * self._by_shape
        return slopes


def _moving(now: LinearisedModes, measured: ModalModel) -> Integers:
    """Channels of one kind that move in the model at all, whatever its stiffness and damping."""
    size = np.abs(now.shapes).max(axis=1, initial=0.0)
    rotation = np.array([dof.is_rotation for dof in measured.outputs], bool)
    kind = rotation if rotation.all() else ~rotation
    return np.flatnonzero(kind & (size > _STILL * size[kind].max(initial=0.0)))
