"""Misfit of a model to a table of modes, as a sum of squares with exact slopes.

    J(x) = 1/2 sum_r [ log^2(w_q / w_r) / sd_w^2 + log^2(zeta_q / zeta_r) / sd_z^2
                       + max(0, d_q + m)^2 / sd_d^2 ] + 1/2 |x|^2

r runs over the rows of the table, q = q(r) is the mode of the model that is matched with row r. The
d of a row that names a motion says whether another motion is larger (``largest_motion``); at
d = -m the named one leads by the margin m. x are the parameters in units of their priors' standard
deviations about the nominal model, so that the priors make the problem regular (Tarantola 2005,
ch. 3): a table of modes determines few of the many parameters.

If the table is complete below a frequency F, every other pole of the model that lies below it adds
1/2 log^2(2 pi F / |s|) / sd_F^2, which drives it out. Real poles count too, or an overdamped mode
would be a way out.

Rows and modes are matched one to one with the least sum of squares (assignment problem, Kuhn 1955
and Munkres 1957). Among rows that name no motion, this is the order of frequencies. Modes are
matched anew at every x, so that J stays continuous if two modes of the model change order.

Slopes follow from those of the poles, s = w (-zeta + i sqrt(1 - zeta^2)), time convention
exp(+i w t): d log w = Re ds / s and d log zeta = Re (1 / Re s - 1 / s) ds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from identification.readers.mode_table import TabulatedMode
from identification.words import Complex, Dof, HasPoles, Integers, Mask, Real
from mbmodel import LinearisedModes, ModeEvaluator, Model
from tuning.misfit.largest_motion import NamedMotion, name_motion
from tuning.misfit.normal_equations import ArrowMatrix, QuadraticModel
from tuning.parametrisation.parametrisation import Parametrisation

# Of a row that states no standard deviation, relative: a model of rigid stages reaches no better.
DEFAULT_FREQUENCY_SD, DEFAULT_DAMPING_SD = 0.01, 0.1
_LIMIT_SD = 0.01  # sd_F
_LARGEST_MOTION_SD = 0.1  # of d: the energies of two motions differ by 10 %
_LARGEST_MOTION_MARGIN = 0.2  # m: the named energy leads by a fifth
MAX_FREQUENCY_RATIO = 3.0  # between a row and its mode: farther apart they are no match
# An error of the frequencies that a stage tolerates, by which it sees farther, goes with errors of
# the damping ratios and of d that are so many times larger.
_FLOOR_RATIOS = np.array([1.0, 10.0, 3.0])


@dataclass(frozen=True, eq=False)
class TableStage:
    """One minimisation of the misfit to a table of modes.

    Args:
        modes: rows of the table, all of whose bodies the machine has.
        model_error_floor: error of log-frequency that is tolerated beside the standard deviations.
        counted: rows that count; all if None; (n_row,).
        complete_below_hz: frequency below which the table has all modes of the machine; None if
            it may lack some.
        min_gain_nats: the search ends when a step is predicted to gain less.
    """

    modes: tuple[TabulatedMode, ...]
    model_error_floor: float = 0.0
    counted: Mask | None = None
    complete_below_hz: float | None = None
    min_gain_nats: float = 0.0


@dataclass(frozen=True, eq=False)
class TableMatch(HasPoles):
    """Rows of the table compared with the modes of the model at one x, and matched with them.

    Args:
        linearised: modes of the model.
        oscillating: numbers of those that oscillate and decay, among all poles; (n_mode,).
        poles: their poles, by rising frequency [rad/s]; (n_mode,).
        energies: kinetic energy of every direction of a body in each; (n_label, n_mode).
        labels: these directions; n_label.
        motions: motions that rows name, by row.
        residuals: frequency, damping and motion, weighted; (3, n_row, n_mode).
        surplus: weighted residual of a pole without a row, below the limit; (n_pole,).
        rows: rows that count and have a partner; (n_match,).
        columns: indices of their modes; (n_match,).
    """

    linearised: LinearisedModes
    oscillating: Integers
    poles: Complex
    energies: Real
    labels: Sequence[Dof]
    motions: Mapping[int, NamedMotion]
    residuals: Real
    surplus: Real
    rows: Integers
    columns: Integers

    @property
    def partner(self) -> Integers:
        """Index of each row's mode among ``poles``, -1 for none; (n_row,)."""
        partner = np.full(self.residuals.shape[1], -1)
        partner[self.rows] = self.columns
        return partner

    @property
    def matched(self) -> Real:
        """Residuals of the rows that have a partner; (3, n_match)."""
        return self.residuals[:, self.rows, self.columns]

    def largest(self, mode: int) -> str:
        """Return the direction of a body with the largest kinetic energy in a mode."""
        dof = self.labels[int(self.energies[:, mode].argmax())]
        return f"{dof.point}:{dof.direction[1:]}"

    def moves_most(self, row: int) -> bool | None:
        """Return whether a row's motion is the largest in its mode; None if it names none."""
        motion = self.motions.get(row)
        return None if motion is None else motion.leads(self.energies[:, self.partner[row]])


class ModeTableMisfit:
    """J as a function of x, with its Gauss-Newton model.

    Args:
        parametrisation: coordinates x; all of them have a prior.
        stage: rows and what counts of them.
    """

    def __init__(self, model: Model, parametrisation: Parametrisation, stage: TableStage) -> None:
        modes, floor = stage.modes, stage.model_error_floor
        self._labels = model.machine.layout.body_dofs()
        self._evaluator = ModeEvaluator(model, self._labels)
        self._body_mass, self._parametrisation = model.machine.body_mass, parametrisation
        self._counted = np.ones(len(modes), bool) if stage.counted is None else stage.counted
        self._motions = {
            row: name_motion(self._labels, mode.body, mode.directions)
            for row, mode in enumerate(modes)
            if mode.body
        }
        self._log_omega = np.log([2 * np.pi * mode.freq_hz for mode in modes])
        self._log_damping = np.array(
            [np.nan if mode.damping is None else np.log(mode.damping) for mode in modes]
        )
        deviations = np.array([(*relative_deviations(m), _LARGEST_MOTION_SD) for m in modes]).T
        self._weights = 1 / np.sqrt(deviations**2 + (floor * _FLOOR_RATIOS[:, None]) ** 2)
        limit = stage.complete_below_hz
        self._log_limit = -np.inf if limit is None else np.log(limit)
        self._limit_weight = 1 / np.hypot(_LIMIT_SD, floor)

    def __call__(self, x: Real) -> tuple[float, Real]:
        """Return J and its gradient."""
        value, gradient, _ = self.quadratic_model(x)
        return value, gradient

    def value(self, x: Real) -> float:
        """Return J."""
        return self._sum(x, self.match(x))

    def quadratic_model(self, x: Real) -> QuadraticModel:
        """Return J, its gradient, and the normal equations without the prior."""
        value, residuals, slopes = self.linearised_residuals(x)
        size, no_blocks = len(x), np.zeros((0, 0), int)
        no_cross, no_own = np.zeros((0, 0, size)), np.zeros((0, 0, 0))
        normal = ArrowMatrix(slopes.T @ slopes, no_cross, no_own, np.arange(size), no_blocks)
        return value, slopes.T @ residuals + x, normal

    def linearised_residuals(self, x: Real) -> tuple[float, Real, Real]:
        """Return J, the weighted residuals of the matched rows, and their slopes by x.

        Returns:
            J, residuals (n_residual,), slopes (n_residual, n_x). Residuals that are zero by
            definition, for lack of a damping ratio or of a larger motion, are left out.
        """
        match = self.match(x)
        linearised, modes = match.linearised, match.oscillating[match.columns]
        poles = linearised.modes.poles
        # ln |s| and ln damping = ln(-Re s) - ln |s| by a parameter, from the slope of s.
        by_pole = linearised.pole_slopes(modes)
        by_size = (by_pole / poles[modes]).real
        by_kind = by_size, by_pole.real / poles[modes].real - by_size
        values, slopes = [], []
        for k, (row, mode) in enumerate(zip(match.rows, modes, strict=True)):
            residuals = match.matched[:, k]
            for kind in np.flatnonzero((residuals != 0) | (np.arange(3) == 0)):
                slope = by_kind[kind][:, k] if kind < 2 else self._slope(linearised, mode, row)
                values.append(residuals[kind])
                slopes.append(self._weights[kind, row] * slope)
        surplus = np.setdiff1d(np.flatnonzero(match.surplus), modes)
        if len(surplus):
            by_limit = (linearised.pole_slopes(surplus) / poles[surplus]).real
            values += match.surplus[surplus].tolist()
            slopes += list(-self._limit_weight * by_limit.T)
        by_x = [self._parametrisation.gradient_by_coordinates(slope, x) for slope in slopes]
        return self._sum(x, match), np.array(values), np.array(by_x).reshape(-1, len(x))

    def reaches_all_rows(self, x: Real, deviations: float) -> bool:
        """Return whether every row that counts has its mode within some standard deviations.

        Args:
            x: coordinates of the parameters.
            deviations: of frequency and damping; a named motion is the largest.
        """
        match = self.match(x)
        is_named = match.matched[2] > _LARGEST_MOTION_MARGIN * self._weights[2, match.rows]
        is_far = (np.abs(match.matched[:2]) > deviations).any(axis=0) | is_named
        return len(match.rows) == int(self._counted.sum()) and not is_far.any()

    def rows_in_reach(self, x: Real) -> Mask:
        """Return which rows have a mode of the model within a factor of 3 in frequency; (n_row,).

        Each mode serves one row. As many rows as possible get a mode, at the least sum of squares.
        """
        residuals = self.match(x).residuals
        cost = 0.5 * (residuals**2).sum(axis=0)
        farthest = np.log(MAX_FREQUENCY_RATIO) * self._weights[0]
        is_near = np.abs(residuals[0]) <= farthest[:, None]
        barred = 1.0 + len(cost) * float(np.where(is_near, cost, 0.0).max(initial=0.0))
        rows, columns = scipy.optimize.linear_sum_assignment(np.where(is_near, cost, barred))
        in_reach = np.zeros(len(cost), bool)
        in_reach[rows] = is_near[rows, columns]
        return in_reach

    def match(self, x: Real) -> TableMatch:
        """Match rows that count with modes of the model at x, at the least sum of squares."""
        linearised = self._evaluator.at(self._parametrisation.theta(x))
        poles, damping = linearised.modes.poles, linearised.modes.damping
        oscillating = np.flatnonzero((poles.imag > 0) & (poles.real < 0))
        motions = linearised.shapes[:, oscillating]
        energies = (motions.conj() * (self._body_mass @ motions)).real
        residuals = np.zeros((3, len(self._log_omega), len(oscillating)))
        residuals[0] = np.log(np.abs(poles[oscillating])) - self._log_omega[:, None]
        residuals[1] = np.nan_to_num(np.log(damping[oscillating]) - self._log_damping[:, None])
        for row, motion in self._motions.items():
            residuals[2, row] = np.maximum(motion.excess(energies) + _LARGEST_MOTION_MARGIN, 0.0)
        residuals *= self._weights[:, :, None]
        sizes = np.abs(poles) / (2 * np.pi)
        sizes[sizes == 0] = np.inf  # motions at rest are no modes in excess
        surplus = np.maximum(self._log_limit - np.log(sizes), 0.0) * self._limit_weight
        # A mode that gets a row no longer counts as surplus.
        cost = 0.5 * ((residuals**2).sum(axis=0) - surplus[oscillating] ** 2)
        counted = np.flatnonzero(self._counted)
        rows, columns = scipy.optimize.linear_sum_assignment(cost[counted])
        return TableMatch(
            linearised,
            oscillating,
            poles[oscillating],
            energies,
            self._labels,
            self._motions,
            residuals,
            surplus,
            counted[rows],
            columns,
        )

    def _sum(self, x: Real, match: TableMatch) -> float:
        """Return J; a row whose mode ceased to oscillate costs as much as the farthest match."""
        unmatched = np.setdiff1d(np.flatnonzero(self._counted), match.rows)
        farthest = 0.5 * (np.log(MAX_FREQUENCY_RATIO) * self._weights[0]) ** 2
        surplus = np.delete(match.surplus, match.oscillating[match.columns])
        squares = (match.matched**2).sum() + surplus @ surplus + x @ x
        return 0.5 * float(squares) + float(farthest[unmatched].sum())

    def _slope(self, linearised: LinearisedModes, mode: int, row: int) -> Real:
        """Return the derivative of a row's excess of another motion by every parameter [1/SI]."""
        shapes = self._motions[row].slope(linearised.shapes[:, mode], self._body_mass)[:, None]
        return linearised.gradient(np.array([mode]), np.zeros(1, complex), shapes)


def relative_deviations(mode: TabulatedMode) -> tuple[float, float]:
    """Return the relative standard deviations of a row's frequency and damping ratio."""
    freq_sd, damping_sd = DEFAULT_FREQUENCY_SD, DEFAULT_DAMPING_SD
    if mode.freq_sd_hz is not None:
        freq_sd = mode.freq_sd_hz / mode.freq_hz
    if mode.damping_sd is not None and mode.damping is not None:
        damping_sd = mode.damping_sd / mode.damping
    return freq_sd, damping_sd
