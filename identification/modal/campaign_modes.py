"""Modal identification of a campaign: all its tests are combined and give one modal model."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from identification.modal.mode_selection import IdentifiedModes, identify_modes
from identification.modal.pole_clusters import ModeCriteria
from identification.modal.reference_agreement import (
    align_references,
    is_better,
    needs_alignment,
)
from identification.modal.shape_fit import WeightedFrfs
from identification.modal.user_choices import ModeChoices
from identification.roving_hammer import is_roving_hammer
from identification.words import (
    DERIVATIVE_ORDER,
    MAX_SHOWN_VALUES,
    Campaign,
    Complex,
    Dof,
    Frf,
    FrfEstimate,
    Input,
    InputError,
    Integers,
    Mask,
    ModalModel,
    Output,
    Quantity,
    Real,
    thinning_step,
)

# Sub-bands in which the noise of a cell is compared with its mean; a count.
_N_NOISE_BANDS = 8
# Variance of a cell in one sub-band over its mean above which that sub-band sets its weight.
_LOCAL_NOISE_RATIO = 2.0
# Variance of a line over the median of its neighbours, at least, and the number of lines of that
# median: with few channels, a coherence near 1 by chance must not give a line all the weight.
_MIN_LINE_VARIANCE_RATIO, _LINE_MEDIAN_LINES = 0.25, 31
# Spread of the line spacing over its mean; files round frequencies to some seven digits.
_MAX_SPACING_UNEVENNESS = 1e-6
# Gaps between lines, where lines were left out, over the number of lines, at most.
_MAX_GAP_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class MeasuredFrfs:
    """FRFs of all tests of a campaign, combined in one array.

    Args:
        freq_hz: frequency lines above 0 Hz on an even axis, perhaps with gaps [Hz]; (n_freq,).
        values: FRFs, zero where not measured; (n_freq, n_out, n_in).
        variance: E|error|^2 of the FRFs; (n_freq, n_out, n_in).
        measured: whether the FRF of an output and an input was measured; (n_out, n_in).
        outputs: degrees of freedom along positive axes; n_out.
        inputs: degrees of freedom along positive axes; n_in.
        order: q of the quantity: 0, 1, 2 for receptance, mobility, accelerance.
        decay: 1 / tau of the exponential window that is still in the data [1/s].
        corrections: sentences on what one run has wrong and was corrected in ``values``.
    """

    freq_hz: Real
    values: Complex
    variance: Real
    measured: Mask
    outputs: tuple[Output, ...]
    inputs: tuple[Input, ...]
    order: int
    decay: float
    corrections: tuple[str, ...] = ()

    @property
    def laplace(self) -> Complex:
        """Laplace variable ``s = decay + i w`` of every line [rad/s]; (n_freq,)."""
        return np.asarray(self.decay + 2j * np.pi * self.freq_hz, np.complex128)

    @property
    def quantity(self) -> Quantity:
        """Quantity of the FRFs, such as ``accelerance``."""
        return next(name for name, order in DERIVATIVE_ORDER.items() if order == self.order)

    @property
    def estimate(self) -> FrfEstimate:
        """The FRFs with their variance."""
        frf = Frf(self.freq_hz, self.values, self.outputs, self.inputs, self.quantity)
        return FrfEstimate(frf, self.variance, "differences", self.measured)

    def transpose(self) -> "MeasuredFrfs":
        """Return the FRFs with inputs and outputs exchanged, by reciprocity H_oi = H_io.

        Motors have no reciprocal channel and are left out.
        """
        kept = [column for column, dof in enumerate(self.inputs) if isinstance(dof, Dof)]
        return replace(
            self,
            values=self.values[:, :, kept].transpose(0, 2, 1),
            variance=self.variance[:, :, kept].transpose(0, 2, 1),
            measured=self.measured[:, kept].T,
            outputs=tuple(dof for dof in self.inputs if isinstance(dof, Dof)),
            inputs=self.outputs,
        )

    def thin_lines(self) -> "MeasuredFrfs":
        """Return every n-th line of a large test, enough to be shown; else all of them."""
        step = thinning_step(self.values.size, MAX_SHOWN_VALUES)
        if step == 1:
            return self
        arrays = {name: getattr(self, name)[::step] for name in ("freq_hz", "values", "variance")}
        return replace(self, **{name: array.copy() for name, array in arrays.items()})

    def weight_by_variance(self) -> WeightedFrfs:
        """Return the FRFs with weights of one over their variance, separable in lines and cells.

        The variance of a cell over that of another hardly depends on the line where the noise is
        that of the sensors. The variance is therefore approximated by a product of line and cell,
        so that one set of sums over lines serves all cells.

        An exponential window correlates the errors of neighbouring lines. White noise times exp(-t
        / tau) in blocks of T has the correlation 2 / (2 + i w tau) between lines w apart. So (T /
        tau) coth(T / tau) lines hold the information of one independent line.
        """
        measured = self.measured
        mean = np.where(measured, self.variance.mean(axis=0), 1.0)
        lines = np.array_split(np.arange(len(self.freq_hz)), _N_NOISE_BANDS)
        medians = [self._line_medians(chosen, mean) for chosen in lines]
        line_variance = _limit_line_weights(*np.concatenate(medians, axis=1))
        # A cell that is far noisier in one sub-band is weighted by the noise of that sub-band,
        # which would otherwise be fitted as modes.
        bands = np.stack(
            [
                np.where(
                    measured,
                    (self.variance[chosen] / mean / line_variance[chosen, None, None]).mean(axis=0),
                    np.nan,
                )
                for chosen in lines
            ]
        )
        worst = np.nan_to_num(bands.max(axis=0), nan=1.0)
        cell_weights = np.where(
            measured, 1.0 / (mean * np.where(worst > _LOCAL_NOISE_RATIO, worst, 1.0)), 0.0
        )
        correlated_lines = 1.0
        if self.decay:
            decay_per_line = self.decay / float(np.diff(self.freq_hz).min())
            correlated_lines = decay_per_line / np.tanh(decay_per_line)
        return WeightedFrfs(
            self.laplace,
            self.order,
            self.values if measured.all() else self.values * measured,
            (1.0 / (correlated_lines * line_variance))[:, None, None],
            cell_weights,
            correlated_lines,
        )

    def _line_medians(self, lines: Integers, mean: Real) -> Real:
        """Return the medians over measured cells of variance and power over the mean variance.

        Args:
            lines: numbers of frequency lines; (n_line,).
            mean: mean variance of each cell; (n_out, n_in).

        Returns:
            (2, n_line).
        """
        variance, power = self.variance[lines], np.abs(self.values[lines]) ** 2
        ratios = [np.where(self.measured, part / mean, np.nan) for part in (variance, power)]
        return np.stack([np.nanmedian(r.reshape(len(lines), -1), axis=1) for r in ratios])


def _limit_line_weights(variance: Real, power: Real) -> Real:
    """Raise the variance of lines that claim to be far better than their neighbours.

    The least that a line may have is a share of the median of its neighbours, of the variance or of
    its ratio to the power, whichever is smaller: resonances have a small ratio, and the variance
    falls with the power towards 0 Hz.

    Args:
        variance: variance of each line; (n_freq,).
        power: squared magnitude of the FRFs, in the same unit; (n_freq,).
    """
    width = min(_LINE_MEDIAN_LINES, len(variance))
    inner = np.clip(np.arange(len(variance)), width // 2, len(variance) - 1 - width // 2)
    safe = np.maximum(power, 1e-300)
    usual = median_filter(variance, width, mode="nearest")[inner]
    usual_ratio = median_filter(variance / safe, width, mode="nearest")[inner]
    least = _MIN_LINE_VARIANCE_RATIO * np.minimum(usual, usual_ratio * safe)
    return np.asarray(np.maximum(variance, least), np.float64)


def _is_even_with_gaps(spacing: Real) -> bool:
    """Return whether lines are evenly spaced but for a few gaps of whole lines.

    The sums of LSCF and of the refinement run over any lines of one even axis.

    Args:
        spacing: distances of neighbouring lines [Hz]; (n_freq - 1,).
    """
    step = float(np.median(spacing))
    steps = np.round(spacing / step)
    allowed = _MAX_SPACING_UNEVENNESS * spacing.mean() * np.maximum(steps, 1)
    is_even = np.abs(spacing - steps * step) <= allowed
    return bool((is_even & (steps >= 1)).all() and (steps > 1).mean() <= _MAX_GAP_SHARE)


def combine_tests(campaign: Campaign) -> MeasuredFrfs:
    """Combine the tests of a campaign in one array of FRFs.

    Where several tests measured a cell, the test with the smallest variance is kept.

    Returns:
        FRFs along positive axes.

    Raises:
        InputError: unevenly spaced lines, fewer than 16 lines, or different exponential windows.
    """
    taus = {test.estimate.window_tau for test in campaign.tests}
    if len(taus) > 1:
        raise InputError(
            f"{campaign.name}: tests carry different exponential windows "
            f"({', '.join(f'{tau:g} s' for tau in sorted(taus))}): identify each test separately"
        )
    above_zero = campaign.freq_hz > 0
    freq = campaign.freq_hz[above_zero]
    spacing = np.diff(freq)
    if len(freq) < 16:
        raise InputError(
            f"{campaign.name}: modes need 16 or more lines above 0 Hz, and the band holds "
            f"{len(freq)}: widen the band"
        )
    if not _is_even_with_gaps(spacing):
        raise InputError(
            f"{campaign.name}: lines are unevenly spaced, from {spacing.min():g} to "
            f"{spacing.max():g} Hz: export FRFs on one even axis"
        )
    outputs, inputs = campaign.outputs, campaign.inputs
    shape = (len(outputs), len(inputs))
    values = np.zeros((len(freq), *shape), complex)
    variance = np.full((len(freq), *shape), np.inf)
    measured = np.zeros(shape, bool)
    for test in campaign.tests:
        frf, reference = test.estimate.frf, test.condition.reference
        column = inputs.index(reference.positive)
        for row, dof in enumerate(frf.outputs):
            cell = (slice(None), outputs.index(dof.positive), column)
            variances = test.estimate.variance[above_zero, row, 0]
            if test.estimate.measured[row, 0] and variances.sum() < variance[cell].sum():
                values[cell] = dof.sign * reference.sign * frf.values[above_zero, row, 0]
                variance[cell], measured[cell[1:]] = variances, True
    tau = taus.pop()
    # A cell of zeros has no variance. AC coupling can leave a line of zeros, which is dropped.
    measured &= (variance > 0).mean(axis=0) > 0.5
    usable = ((variance > 0) | ~measured).all(axis=(1, 2))
    values[:, ~measured], variance[:, ~measured] = 0.0, 0.0
    chosen = slice(None) if usable.all() else usable  # a mask copies
    return MeasuredFrfs(
        freq[chosen],
        values[chosen],
        variance[chosen],
        measured,
        outputs,
        inputs,
        DERIVATIVE_ORDER[campaign.tests[0].estimate.frf.quantity],
        1.0 / tau if tau else 0.0,
    )


def identify(
    campaign: Campaign, criteria: ModeCriteria | None = None, choices: ModeChoices | None = None
) -> tuple[ModalModel, IdentifiedModes, MeasuredFrfs]:
    """Identify the modal model of a campaign.

    Modes outside the band stay in the model, after those inside it, since the residuals alone
    cannot stand for them. ``IdentifiedModes.inside`` marks the modes of the band.

    In a roving-hammer test the shape lies in the inputs. By reciprocity the impact points are then
    the outputs of all three results, and the sensors their inputs.

    Args:
        choices: modes that the user adds, drops or forces.

    Returns:
        The modal model, the identified modes with their statistics, and the FRFs that were fitted.

    Raises:
        InputError: tests that cannot be combined, tests in several machines, or no cell with a
            known variance.
        UsageError: a choice that the data do not allow.
    """
    if len(campaign.variants) > 1:
        names = ", ".join(name or "the campaign's model" for name in campaign.variants)
        raise InputError(
            f"{campaign.name}: its tests were made in several machines ({names}), each with modes "
            "of its own: select the tests of one"
        )
    measured = combine_tests(campaign)
    silent = np.flatnonzero(~measured.measured.any(axis=0))
    if len(silent) and len(silent) < len(measured.inputs):
        names = ", ".join(str(measured.inputs[column]) for column in silent)
        raise InputError(
            f"{campaign.name}: no channel has a known response to {names}: leave that reference out"
        )
    if is_roving_hammer(campaign):
        measured = measured.transpose()
    data = measured.weight_by_variance()
    if not data.cells.any():
        raise InputError(f"{campaign.name}: no channel has a known variance: check the export")
    identified = identify_modes(data, measured.freq_hz, criteria, choices)
    if not is_roving_hammer(campaign):  # its sensors measured each hit at once
        measured, identified = _align(measured, identified, criteria, choices)
    order = np.argsort(~identified.inside, kind="stable")
    fit = identified.fit
    model = ModalModel(
        poles=fit.poles[order],
        shapes=fit.shapes[:, order],
        participation=fit.participation[:, order],
        lower=fit.lower,
        upper=fit.upper,
        outputs=measured.outputs,
        inputs=measured.inputs,
        freq_sd=identified.freq_sd[order],
        damping_sd=identified.damping_sd[order],
    )
    return model, identified, measured


def _align(
    measured: MeasuredFrfs,
    identified: IdentifiedModes,
    criteria: ModeCriteria | None,
    choices: ModeChoices | None,
) -> tuple[MeasuredFrfs, IdentifiedModes]:
    """Correct what one run has wrong, if references disagree and the modes then fit better."""
    if not needs_alignment(identified):
        return measured, identified
    alignment = align_references(
        measured.weight_by_variance(),
        [str(dof) for dof in measured.outputs],
        [str(dof) for dof in measured.inputs],
        lambda column: identify_modes(column, measured.freq_hz, criteria, is_quick=True),
    )
    if alignment is None:
        return measured, identified
    aligned = replace(measured, values=alignment.values, corrections=alignment.sentences)
    refit = identify_modes(aligned.weight_by_variance(), measured.freq_hz, criteria, choices)
    return (aligned, refit) if is_better(refit, identified) else (measured, identified)
