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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from identification.readers.mode_table import TabulatedMode
from identification.words import Integers, Mask, Real
from mbmodel import LinearisedModes, ModeEvaluator, Model
from tuning.misfit.normal_equations import ArrowMatrix, QuadraticModel
from tuning.mode_table.largest_motion import NamedMotion, kinetic_energies, name_motion
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
class TableMatch:
    """Modes of the model matched with rows of the table.

    Args:
        partner: index of each row's mode among ``modes``, -1 for none; (n_row,).
        freq_hz: natural frequencies of the modes that oscillate, rising [Hz]; (n_mode,).
        damping: their damping ratios; (n_mode,).
        largest: direction of a body with the largest kinetic energy in each, as ``ty:tz``; n_mode.
        moves_most: whether the motion that a row names is the largest in its mode, False without a
            partner or a named motion; (n_row,).
    """

    partner: Integers
    freq_hz: Real
    damping: Real
    largest: tuple[str, ...]
    moves_most: Mask


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Every row compared with every mode of the model that oscillates.

    Args:
        linearised: modes of the model.
        oscillating: their numbers among all poles; (n_mode,).
        residuals: frequency, damping and motion, weighted; (3, n_row, n_mode).
        surplus: weighted residual of a pole without a row, below the limit; (n_pole,).
    """

    linearised: LinearisedModes
    oscillating: Integers
    residuals: Real
    surplus: Real


class ModeTableMisfit:
    """J as a function of x, with its Gauss-Newton model.

    Args:
        model: machine and Parts.
        modes: rows of the table, all of whose bodies the machine has.
        parametrisation: coordinates x; all of them have a prior.
        floor: error of log-frequency that is tolerated beside the standard deviations.
        counted: rows that count; all if None; (n_row,).
        complete_below_hz: frequency below which the table has all modes of the machine; None if
            it may lack some.
    """

    def __init__(  # one for each choice
        self,
        model: Model,
        modes: Sequence[TabulatedMode],
        parametrisation: Parametrisation,
        *,
        floor: float = 0.0,
        counted: Mask | None = None,
        complete_below_hz: float | None = None,
    ) -> None:
        labels = model.machine.layout.body_dofs()
        self._labels = labels
        self._evaluator = ModeEvaluator(model, labels)
        self._body_mass = model.machine.body_mass
        self._parametrisation = parametrisation
        self._counted = np.ones(len(modes), bool) if counted is None else counted
        self._motions: list[NamedMotion | None] = [
            name_motion(labels, mode.body, mode.directions) if mode.body else None for mode in modes
        ]
        self._log_omega = np.log([2 * np.pi * mode.freq_hz for mode in modes])
        self._log_damping = np.array(
            [np.nan if mode.damping is None else np.log(mode.damping) for mode in modes]
        )
        deviations = np.array([relative_deviations(mode) for mode in modes]).T
        deviations = np.vstack([deviations, np.full(len(modes), _LARGEST_MOTION_SD)])
        self._weights = 1 / np.sqrt(deviations**2 + (floor * _FLOOR_RATIOS[:, None]) ** 2)
        self._log_limit = -np.inf if complete_below_hz is None else np.log(complete_below_hz)
        self._limit_weight = 1 / np.hypot(_LIMIT_SD, floor)
        self._unmatched_cost = 0.5 * (np.log(MAX_FREQUENCY_RATIO) * self._weights[0]) ** 2

    def __call__(self, x: Real) -> tuple[float, Real]:
        """Return J and its gradient."""
        value, gradient, _ = self.quadratic_model(x)
        return value, gradient

    def value(self, x: Real) -> float:
        """Return J."""
        compared = self._compare(x)
        rows, columns = self._match(compared)
        return self._sum(x, compared, rows, columns)

    def quadratic_model(self, x: Real) -> QuadraticModel:
        """Return J, its gradient, and the normal equations without the prior."""
        value, residuals, slopes = self.linearised_residuals(x)
        normal = slopes.T @ slopes
        empty = np.zeros((0, 0), int)
        size = len(x)
        arrow = ArrowMatrix(
            normal, np.zeros((0, 0, size)), np.zeros((0, 0, 0)), np.arange(size), empty
        )
        return value, slopes.T @ residuals + x, arrow

    def linearised_residuals(self, x: Real) -> tuple[float, Real, Real]:
        """Return J, the weighted residuals of the matched rows, and their slopes by x.

        Returns:
            J, residuals (n_residual,), slopes (n_residual, n_x). Residuals that are zero by
            definition, for lack of a damping ratio or of a larger motion, are left out.
        """
        compared = self._compare(x)
        rows, columns = self._match(compared)
        modes = compared.oscillating[columns]
        poles = compared.linearised.modes.poles[modes]
        # ln |s| and ln damping = ln(-Re s) - ln |s| by a parameter, from the slope of s.
        by_pole = compared.linearised.pole_slopes(modes)
        by_size = (by_pole / poles).real
        by_kind = by_size, by_pole.real / poles.real - by_size
        values, slopes = [], []
        for k, row in enumerate(rows):
            residuals = compared.residuals[:, row, columns[k]]
            for kind in np.flatnonzero((residuals != 0) | (np.arange(3) == 0)):
                slope = (
                    by_kind[kind][:, k]
                    if kind < 2
                    else self._shape_slope(compared.linearised, modes[k], row)
                )
                values.append(residuals[kind])
                slopes.append(self._weights[kind, row] * slope)
        surplus = np.setdiff1d(np.flatnonzero(compared.surplus), modes)
        if len(surplus):
            by_limit = (
                compared.linearised.pole_slopes(surplus) / compared.linearised.modes.poles[surplus]
            ).real
            values += compared.surplus[surplus].tolist()
            slopes += list(-self._limit_weight * by_limit.T)
        stacked = np.array(slopes).reshape(-1, len(compared.linearised.theta))
        by_x = np.array(
            [self._parametrisation.gradient_by_coordinates(slope, x) for slope in stacked]
        ).reshape(-1, len(x))
        value = self._sum(x, compared, rows, columns)
        return value, np.array(values), by_x

    def reaches_all_rows(self, x: Real, deviations: float) -> bool:
        """Return whether every row that counts has its mode within some standard deviations.

        Args:
            x: coordinates of the parameters.
            deviations: of frequency and damping; a named motion is the largest.
        """
        compared = self._compare(x)
        rows, columns = self._match(compared)
        residuals = compared.residuals[:, rows, columns]
        is_named = residuals[2] > _LARGEST_MOTION_MARGIN * self._weights[2, rows]
        is_far = (np.abs(residuals[:2]) > deviations).any(axis=0) | is_named
        return len(rows) == int(self._counted.sum()) and not is_far.any()

    def pair_modes(self, x: Real) -> TableMatch:
        """Return the modes of the model at x that are matched with the rows that count."""
        compared = self._compare(x)
        rows, columns = self._match(compared)
        modes, oscillating = compared.linearised.modes, compared.oscillating
        partner = np.full(len(self._counted), -1)
        partner[rows] = columns
        moves_most = np.zeros(len(self._counted), bool)
        energies = kinetic_energies(compared.linearised.shapes[:, oscillating], self._body_mass)
        for row, column in zip(rows, columns, strict=True):
            motion = self._motions[row]
            if motion is not None:
                moves_most[row] = motion.leads(energies[:, column])
        largest = [self._labels[k] for k in energies.argmax(axis=0)]
        return TableMatch(
            partner,
            modes.freq_hz[oscillating],
            modes.damping[oscillating],
            tuple(f"{dof.point}:{dof.direction[1:]}" for dof in largest),
            moves_most,
        )

    def _compare(self, x: Real) -> _Comparison:
        """Compare every row with every mode of the model that oscillates and decays."""
        linearised = self._evaluator.at(self._parametrisation.theta(x))
        modes = linearised.modes
        oscillating = np.flatnonzero((modes.poles.imag > 0) & (modes.poles.real < 0))
        residuals = np.zeros((3, len(self._log_omega), len(oscillating)))
        residuals[0] = np.log(np.abs(modes.poles[oscillating])) - self._log_omega[:, None]
        by_damping = np.log(modes.damping[oscillating]) - self._log_damping[:, None]
        residuals[1] = np.nan_to_num(by_damping)
        if any(motion is not None for motion in self._motions):
            energies = kinetic_energies(linearised.shapes[:, oscillating], self._body_mass)
            for row, motion in enumerate(self._motions):
                if motion is not None:
                    excess = motion.excess(energies) + _LARGEST_MOTION_MARGIN
                    residuals[2, row] = np.maximum(excess, 0.0)
        sizes = np.abs(modes.poles) / (2 * np.pi)
        below = np.where(sizes > 0, self._log_limit - np.log(np.where(sizes > 0, sizes, 1.0)), 0.0)
        return _Comparison(
            linearised,
            oscillating,
            residuals * self._weights[:, :, None],
            np.maximum(below, 0.0) * self._limit_weight,
        )

    def _match(self, compared: _Comparison) -> tuple[Integers, Integers]:
        """Return rows and modes of the model of the assignment with the least sum of squares.

        Returns:
            Rows that count and have a partner, and the indices of their modes; (n_match,) each.
        """
        # A mode that gets a row no longer counts as surplus.
        surplus = compared.surplus[compared.oscillating]
        cost = 0.5 * ((compared.residuals**2).sum(axis=0) - surplus**2)
        counted = np.flatnonzero(self._counted)
        rows, columns = scipy.optimize.linear_sum_assignment(cost[counted])
        return counted[rows], columns

    def rows_in_reach(self, x: Real) -> Mask:
        """Return which rows have a mode of the model within a factor of 3 in frequency; (n_row,).

        Each mode serves one row. As many rows as possible get a mode, at the least sum of squares.
        """
        compared = self._compare(x)
        cost = 0.5 * (compared.residuals**2).sum(axis=0)
        farthest = np.log(MAX_FREQUENCY_RATIO) * self._weights[0]
        is_near = np.abs(compared.residuals[0]) <= farthest[:, None]
        barred = 1.0 + len(cost) * float(np.where(is_near, cost, 0.0).max(initial=0.0))
        rows, columns = scipy.optimize.linear_sum_assignment(np.where(is_near, cost, barred))
        in_reach = np.zeros(len(cost), bool)
        in_reach[rows] = is_near[rows, columns]
        return in_reach

    def _sum(self, x: Real, compared: _Comparison, rows: Integers, columns: Integers) -> float:
        """Return J; a row whose mode ceased to oscillate costs as much as the farthest match."""
        unmatched = np.setdiff1d(np.flatnonzero(self._counted), rows)
        surplus = np.delete(compared.surplus, compared.oscillating[columns])
        squares = (compared.residuals[:, rows, columns] ** 2).sum() + surplus @ surplus + x @ x
        return 0.5 * float(squares) + float(self._unmatched_cost[unmatched].sum())

    def _shape_slope(self, linearised: LinearisedModes, mode: int, row: int) -> Real:
        """Return the derivative of a row's excess of another motion by every parameter [1/SI]."""
        motion = self._motions[row]
        if motion is None:
            return np.zeros(len(linearised.theta))
        shapes = motion.slope(linearised.shapes[:, mode], self._body_mass)[:, None]
        return linearised.gradient(np.array([mode]), np.zeros(1, complex), shapes)


def relative_deviations(mode: TabulatedMode) -> tuple[float, float]:
    """Return the relative standard deviations of a row's frequency and damping ratio."""
    freq_sd = DEFAULT_FREQUENCY_SD if mode.freq_sd_hz is None else mode.freq_sd_hz / mode.freq_hz
    damping_sd = (
        DEFAULT_DAMPING_SD
        if mode.damping_sd is None or mode.damping is None
        else mode.damping_sd / mode.damping
    )
    return freq_sd, damping_sd
