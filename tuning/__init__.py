"""Where measurement and model meet: fits, gaps, held-out predictions."""

from tuning.batch import predict
from tuning.fit import STAGES, Fit, Progress, Stage, fit, random_starts
from tuning.folds import FOLDS, HeldOut, block_width, fit_held_out, fold_of_lines
from tuning.gap import ChannelGaps, Gap, channel_gaps, summarise
from tuning.modal import (
    MODAL_STAGES,
    ModalCost,
    ModalStage,
    Pairs,
    modes_in_band,
    some_modes,
)
from tuning.residual import LogCost
from tuning.result import Level, Result, check_folder, files_of, read_result, write_result
from tuning.schema import PairRow, PartnerRow, Residual, ShareRow, TunedFile
from tuning.session import Session, open_campaign, open_session
from tuning.solver import Minimum, minimise
from tuning.tuned import Comparison, Tuned, Watch, at_bodies, stages_of, tune

__all__ = [
    "FOLDS",
    "MODAL_STAGES",
    "STAGES",
    "ChannelGaps",
    "Comparison",
    "Fit",
    "Gap",
    "HeldOut",
    "Level",
    "LogCost",
    "Minimum",
    "ModalCost",
    "ModalStage",
    "PairRow",
    "Pairs",
    "PartnerRow",
    "Progress",
    "Residual",
    "Result",
    "Session",
    "ShareRow",
    "Stage",
    "Tuned",
    "TunedFile",
    "Watch",
    "at_bodies",
    "block_width",
    "channel_gaps",
    "check_folder",
    "files_of",
    "fit",
    "fit_held_out",
    "fold_of_lines",
    "minimise",
    "modes_in_band",
    "open_campaign",
    "open_session",
    "predict",
    "random_starts",
    "read_result",
    "some_modes",
    "stages_of",
    "summarise",
    "tune",
    "write_result",
]
