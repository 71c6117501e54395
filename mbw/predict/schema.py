"""Rows of the JSON file of ``mbw predict``."""

from identification.readers.result_files import ResultFile, ResultRow
from mbw.plant.margin_schema import MarginsRow
from mbw.plant.schema import BudgetRow, PoleRow, StrutsRow

Shares = dict[str, float]


class ModeRow(PoleRow):
    """A mode of a machine: one real pole or pair of complex poles.

    ``name`` is that of a mode of zero frequency, such as ``rigid tx``; else null.
    """

    name: str | None


class PredictedModeRow(ModeRow):
    """A mode with its energy; shares below 0.001 are left out.

    Args:
        strain, dissipation: share of each joint coordinate or tendon in strain energy and
            dissipation.
        strain_by_stage, dissipation_by_stage: sums of these shares for each stage.
        kinetic: share of each direction of each body in the kinetic energy.
        kinetic_by_body: sums of these shares for each body.
        shape_real, shape_imaginary: motion at the file's ``shape_labels`` for a modal mass of 1 kg.
    """

    strain: Shares
    strain_by_stage: Shares
    dissipation: Shares
    dissipation_by_stage: Shares
    kinetic: Shares
    kinetic_by_body: Shares
    shape_real: list[float]
    shape_imaginary: list[float]


class AddedMassRow(ResultRow):
    """A point mass: [kg], and its offset from the body's centre of mass in world axes [m]."""

    body: str
    mass: float
    offset: list[float]


class BeforeAfterRow(ResultRow):
    """A mode before and after.

    Args:
        before, after: numbers of the modes in ``before`` and ``modes``, from 0.
        mac: of their motions of the common bodies, weighted by mass.
        frequency_change: relative to the frequency before; null for a mode at rest.
        damping_before, damping_after: damping ratios; null for a mode at rest.
    """

    before: int
    after: int
    mac: float
    frequency_change: float | None
    damping_before: float | None
    damping_after: float | None


class FrfPeakRow(ResultRow):
    """Largest magnitude of an FRF on the page before and after, with its frequencies [Hz].

    An FRF at a label that the machine alone does not have has null before.
    """

    label: str
    unit: str
    peak_before: float | None
    peak_before_hz: float | None
    peak_after: float | None
    peak_after_hz: float | None


class PutOnTopRow(ResultRow):
    """The mounted stage and added masses, and the modes before and after.

    Args:
        combined: file name of the combined MJCF in the folder of the result.
        stage: path of the mounted stage; null without one.
        at: body and place that carry the stage.
        prefix: of the stage's names in the combined machine.
        added_masses: point masses.
        before: modes of the machine alone.
        pairs: modes before and after that are alike.
        new, gone: modes after and before without a partner, from 0.
        frfs: largest magnitudes of the FRFs on the page.
    """

    combined: str
    stage: str | None
    at: str | None
    prefix: str
    added_masses: list[AddedMassRow]
    before: list[ModeRow]
    pairs: list[BeforeAfterRow]
    new: list[int]
    gone: list[int]
    frfs: list[FrfPeakRow]


class LawRow(ResultRow):
    """A law of springs that is no polynomial in s, and its approximation in the state space.

    Args:
        parameter: such as ``tilt_tx.loss_factor``; ``loop:ty`` for a control loop that is closed.
        kind: ``exact``, ``pade``, ``tustin``, ``fitted poles``, or ``positive frequencies`` of a
            constant loss.
        order: of the rational function.
        states: that it adds.
        max_error, rms_error: of the law over the lines of the band, relative to its largest
            magnitude there; of a constant loss, of the accelerance along the spring.
        weighted_error: equal to rms_error.
        max_error_of_stiffness: largest error relative to the static stiffness; null for a control
            loop and a constant loss.
        is_passive: whether the approximation dissipates at every frequency; null for laws that
            need not.
    """

    parameter: str
    kind: str
    order: int
    states: int
    max_error: float
    rms_error: float
    weighted_error: float
    max_error_of_stiffness: float | None
    is_passive: bool | None


class StateSpaceCheckRow(ResultRow):
    """Difference of the FRFs of the state space from those of the equation of motion.

    Args:
        outputs, inputs: labels of the FRFs.
        quantity: of the FRFs.
        band: lowest and highest line [Hz].
        lines: number of lines.
        states: of the state space.
        max_difference: largest difference relative to the peak of its FRF.
        rms_difference: root mean square over FRFs of the relative difference.
        worst_output, worst_input, worst_hz: where the largest difference is.
        is_stable: whether no pole of the state space grows.
        laws: what the state space approximates.
    """

    outputs: list[str]
    inputs: list[str]
    quantity: str
    band: tuple[float, float]
    lines: int
    states: int
    max_difference: float
    rms_difference: float
    worst_output: str
    worst_input: str
    worst_hz: float
    is_stable: bool
    laws: list[LawRow]


class BandsRow(ResultRow):
    """Bands of the requested FRFs.

    Args:
        median: median over FRFs and lines of the relative half width of the 95 % interval.
        most: 95 % quantile of it.
        error_floor: relative error of the model at its sensors beside the noise.
        discrepancy: relative error of the machine's forces that the bands hold.
        coordinates: number of coordinates of the posterior.
        remark: on a band beyond that of the test; empty within it.
    """

    median: float
    most: float
    error_floor: float
    discrepancy: float
    coordinates: int
    remark: str = ""


class UncertainPlantRow(ResultRow):
    """Uncertain plant F_u(M, Delta).

    Args:
        blocks: number of parameters with a block.
        exact_blocks: number of those that it holds exactly.
        width: size of Delta.
        states: of M.
        max_error: largest error at samples of the posterior, relative to the peak of its FRF.
        samples: number of these samples.
    """

    blocks: int
    exact_blocks: int
    width: int
    states: int
    max_error: float
    samples: int


class WeightRow(ResultRow):
    """Weight that bounds the held-out error at the inputs.

    Args:
        order: of the filter.
        ratio: largest ratio of the filter to what it bounds.
        median, largest: of what it bounds, over lines.
        quantile: over the lines of a window, which is what it bounds.
        has_one_unit: whether all inputs have one unit; else the error depends on their units.
    """

    order: int
    ratio: float
    median: float
    largest: float
    quantile: float
    has_one_unit: bool


class ReductionRow(ResultRow):
    """Reduction of the state space.

    Args:
        method: ``balanced`` or ``modal``.
        states, whole_states: after and before.
        kept_states: of rigid, undamped and unstable modes, which stay.
        bound: of the error at every frequency, relative to the peak of its FRF in the band.
        max_error: largest error in the band, relative to that peak.
    """

    method: str
    states: int
    whole_states: int
    kept_states: int
    bound: float
    max_error: float


PlantRow = (
    BandsRow | UncertainPlantRow | WeightRow | ReductionRow | BudgetRow | StrutsRow | MarginsRow
)


class PredictedModesFile(ResultFile):
    """Content of the JSON file of ``mbw predict --json``.

    Args:
        doubts: about the fit of the machine of a tuning or diagnosis; only with any.
        put_on_top: only with ``--mount`` or ``--add-mass``.
        state_space_check: only with ``--check``.
        bands, uncertain_plant, weight, reduction: only with the options of these names.
        budget, struts: only with the options of these names.
        margins: of closed loops, only without a budget, which has its own.
    """

    doubts: list[str] = []
    model: str
    remarks: list[str]
    bodies: list[str]
    coordinates: list[str]
    shape_labels: list[str]
    modes: list[PredictedModeRow]
    put_on_top: PutOnTopRow | None = None
    state_space_check: StateSpaceCheckRow | None = None
    bands: BandsRow | None = None
    uncertain_plant: UncertainPlantRow | None = None
    weight: WeightRow | None = None
    reduction: ReductionRow | None = None
    budget: BudgetRow | None = None
    struts: StrutsRow | None = None
    margins: MarginsRow | None = None
