"""Where measurement and model meet: fits, gaps, held-out predictions."""

from tuning.batch import predict
from tuning.confidence import PLAUSIBLE, QUANTILE, Confidence, confidence, pulls
from tuning.fit import GAUSS_NEWTON, Fit, Progress, fit, random_starts
from tuning.folds import FOLDS, HeldOut, block_width, fit_held_out, fold_of_lines
from tuning.foreseen import channel_noise, foreseen
from tuning.freedom import BOUND, Freedom
from tuning.gap import ChannelGaps, Gap, at_bodies, channel_gaps, gap_at_bodies, summarise
from tuning.inputs import fingerprint
from tuning.journal import CHECKPOINT, Journal
from tuning.misfit import Misfit
from tuning.modal import (
    MODAL_STAGES,
    ModalCost,
    ModalStage,
    Pairs,
    modes_in_band,
    some_modes,
)
from tuning.result import Level, Result, check_folder, files_of, read_result, write_result
from tuning.runs import Freed, Probed
from tuning.schema import PairRow, PartnerRow, Place, Residual, ShareRow, TunedFile
from tuning.session import Session, on_machine, open_campaign, open_session, with_tolerances
from tuning.solver import Minimum, minimise
from tuning.stages import STAGES, Stage, counted_lines, thinned
from tuning.tuned import Comparison, Tuned, Watch, stages_of, tune
from tuning.wishes import Wishes, freedom

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
