"""All tests of a campaign to one modal model."""

from dataclasses import dataclass, replace

import numpy as np

from identification.checks.roving_hammer import is_roved
from identification.modal.mode_selection import Identified, identify_modes
from identification.modal.pole_clusters import Tolerances
from identification.modal.refinement import Data
from identification.modal.user_choices import Wishes
from identification.words import (
    ORDER,
    Campaign,
    Complex,
    Dof,
    InputError,
    Mask,
    ModalModel,
    Real,
)

_PARTS = 8  # of the band
_FAR = 2.0  # times its mean, what the variance of a cell must be in a part to count there
_EVEN = 1e-6  # unevenness of the lines, relative to their spacing


@dataclass(frozen=True, eq=False)
class Measured:
    """The tests of a campaign side by side.

    Args:
        freq_hz: lines above 0 Hz [Hz]; (n_freq,).
        values: FRFs, zero where not measured; (n_freq, n_out, n_in).
        variance: of them; likewise.
        measured: (n_out, n_in).
        outputs: along positive axes; n_out.
        inputs: likewise; n_in.
        order: q of the quantity.
        decay: 1 / tau of the exponential window still in the data [1/s].
    """

    freq_hz: Real
    values: Complex
    variance: Real
    measured: Mask
    outputs: tuple[Dof, ...]
    inputs: tuple[Dof, ...]
    order: int
    decay: float

    @property
    def laplace(self) -> Complex:
        """The s of every line; (n_freq,)."""
        return np.asarray(self.decay + 2j * np.pi * self.freq_hz, np.complex128)

    def exchanged(self) -> "Measured":
        """Inputs for outputs, by reciprocity H_oi = H_io."""
        return replace(
            self,
            values=self.values.transpose(0, 2, 1),
            variance=self.variance.transpose(0, 2, 1),
            measured=self.measured.T,
            outputs=self.inputs,
            inputs=self.outputs,
        )

    def data(self) -> Data:
        """What is fitted, weighted by the variance of lines times that of cells.

        The variance of a cell over that of another hardly depends on the line where noise is the
        sensors' own, so that the product of both means serves; one set of sums over lines then
        serves all cells.

        An exponential window makes the errors of neighbouring lines alike. White noise times
        exp(-t / tau) in blocks of T has the correlation 2 / (2 + i w tau) between lines w apart,
        so that (T / tau) coth(T / tau) lines tell as much as one.
        """
        known = self.measured
        mean = np.where(known, self.variance.mean(axis=0), 1.0)
        relative = np.where(known, self.variance / mean, np.nan)
        lines = np.nanmedian(relative.reshape(len(self.freq_hz), -1), axis=1)
        # A cell that is far noisier in a part of the band weighs by that part: its noise there
        # would pass for modes.
        parts = np.stack(
            [part.mean(axis=0) for part in np.array_split(relative / lines[:, None, None], _PARTS)]
        )
        worst = np.nan_to_num(parts.max(axis=0), nan=1.0)
        cells = np.where(known, 1.0 / (mean * np.where(worst > _FAR, worst, 1.0)), 0.0)
        alike = 1.0
        if self.decay:
            lengths = self.decay / float(self.freq_hz[1] - self.freq_hz[0])
            alike = lengths / np.tanh(lengths)
        return Data(
            self.laplace,
            self.order,
            self.values * known,
            (1.0 / (alike * lines))[:, None, None],
            cells,
            alike,
        )


def beside(campaign: Campaign) -> Measured:
    """Put the tests of a campaign side by side.

    A cell that several tests measured keeps the one with the least variance.

    Raises:
        InputError: lines that are not evenly spaced, or different exponential windows.
    """
    taus = {test.estimate.window_tau for test in campaign.tests}
    if len(taus) > 1:
        raise InputError(
            f"{campaign.name}: tests carry different exponential windows "
            f"({', '.join(f'{tau:g} s' for tau in sorted(taus))}): identify them one by one"
        )
    moving = campaign.freq_hz > 0
    freq = campaign.freq_hz[moving]
    spacing = np.diff(freq)
    if len(freq) < 16:
        raise InputError(
            f"{campaign.name}: {len(freq)} lines above 0 Hz are too few for modes: widen the band "
            "to 16 or more"
        )
    if np.ptp(spacing) > _EVEN * spacing.mean():
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
            place = (slice(None), outputs.index(dof.positive), column)
            own = test.estimate.variance[moving, row, 0]
            if test.estimate.measured[row, 0] and own.sum() < variance[place].sum():
                values[place] = dof.sign * reference.sign * frf.values[moving, row, 0]
                variance[place], measured[place[1:]] = own, True
    tau = taus.pop()
    # A cell of zeros has no variance; a line of zeros, as of AC coupling, is no line.
    measured &= (variance > 0).mean(axis=0) > 0.5
    there = ((variance > 0) | ~measured).all(axis=(1, 2))
    return Measured(
        freq[there],
        (values * measured)[there],
        np.where(measured, variance, 0.0)[there],
        measured,
        outputs,
        inputs,
        ORDER[campaign.tests[0].estimate.frf.quantity],
        1.0 / tau if tau else 0.0,
    )


def identify(
    campaign: Campaign, tolerances: Tolerances | None = None, wishes: Wishes | None = None
) -> tuple[ModalModel, Identified, Measured]:
    """The modal model of a campaign, how it was found, and what it was found from.

    Modes beside the band stay in the model, after those inside it, since the residuals alone do
    not stand for them; ``Identified.inside`` counts the modes found.

    The shape of a roving hammer is in its inputs: by reciprocity the points that were hit are the
    outputs of all three, the sensors their inputs.

    Raises:
        InputError: tests that cannot stand side by side, no cell with a known variance.
        UsageError: a wish that the data cannot grant.
    """
    measured = beside(campaign)
    if is_roved(campaign):
        measured = measured.exchanged()
    data = measured.data()
    if not data.cells.any():
        raise InputError(f"{campaign.name}: no channel has a known variance: check the export")
    found = identify_modes(data, measured.freq_hz, tolerances, wishes)
    order = np.argsort(~found.inside, kind="stable")
    fit = found.fit
    model = ModalModel(
        poles=fit.poles[order],
        shapes=fit.shapes[:, order],
        participation=fit.participation[:, order],
        lower=fit.lower,
        upper=fit.upper,
        outputs=measured.outputs,
        inputs=measured.inputs,
        freq_sd=found.freq_sd[order],
        damping_sd=found.damping_sd[order],
    )
    return model, found, measured
