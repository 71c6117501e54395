"""Where measurement and model meet: fits, gaps, held-out predictions."""

from tuning.assessment.gap import (
    ChannelGaps,
    Gap,
    at_bodies,
    channel_gaps,
    gap_at_bodies,
    summarise,
)
from tuning.assessment.held_out import FOLDS, HeldOut, block_width, fit_held_out, fold_of_lines
from tuning.assessment.parameter_confidence import (
    PLAUSIBLE,
    QUANTILE,
    Confidence,
    confidence,
    pulls,
)
from tuning.assessment.predicted_tests import channel_noise, foreseen
from tuning.campaign_tuning import Comparison, Tuned, Watch, stages_of, tune
from tuning.files.input_files import fingerprint
from tuning.files.result import Level, Result, check_folder, files_of, read_result, write_result
from tuning.files.schema import PairRow, PartnerRow, Place, Residual, ShareRow, TunedFile
from tuning.fitting.checkpoint import CHECKPOINT, Journal
from tuning.fitting.fitter import GAUSS_NEWTON, Fit, Progress, fit, random_starts
from tuning.fitting.stages import STAGES, Stage, counted_lines, thinned
from tuning.misfit.accumulation import Freed, Probed
from tuning.misfit.batch import predict
from tuning.misfit.misfit import Misfit
from tuning.misfit.modal_misfit import (
    MODAL_STAGES,
    ModalCost,
    ModalStage,
    Pairs,
    modes_in_band,
    some_modes,
)
from tuning.parametrisation.parametrisation import BOUND, Freedom
from tuning.parametrisation.user_specification import Wishes, freedom
from tuning.session import Session, on_machine, open_campaign, open_session, with_tolerances
from tuning.solvers.nlopt_solver import Minimum, minimise

__all__ = [
    "BOUND",
    "CHECKPOINT",
    "FOLDS",
    "GAUSS_NEWTON",
    "MODAL_STAGES",
    "PLAUSIBLE",
    "QUANTILE",
    "STAGES",
    "ChannelGaps",
    "Comparison",
    "Confidence",
    "Fit",
    "Freed",
    "Freedom",
    "Gap",
    "HeldOut",
    "Journal",
    "Level",
    "Minimum",
    "Misfit",
    "ModalCost",
    "ModalStage",
    "PairRow",
    "Pairs",
    "PartnerRow",
    "Place",
    "Probed",
    "Progress",
    "Residual",
    "Result",
    "Session",
    "ShareRow",
    "Stage",
    "Tuned",
    "TunedFile",
    "Watch",
    "Wishes",
    "at_bodies",
    "block_width",
    "channel_gaps",
    "channel_noise",
    "check_folder",
    "confidence",
    "counted_lines",
    "files_of",
    "fingerprint",
    "fit",
    "fit_held_out",
    "fold_of_lines",
    "foreseen",
    "freedom",
    "gap_at_bodies",
    "minimise",
    "modes_in_band",
    "on_machine",
    "open_campaign",
    "open_session",
    "predict",
    "pulls",
    "random_starts",
    "read_result",
    "some_modes",
    "stages_of",
    "summarise",
    "thinned",
    "tune",
    "with_tolerances",
    "write_result",
]
