"""Where measurement and model meet: fits, gaps, held-out predictions."""

from tuning.batch import predict
from tuning.fit import STAGES, Fit, Progress, Stage, fit, random_starts
from tuning.folds import HeldOut, block_width, fold_of_lines, predict_held_out
from tuning.gap import ChannelGaps, Gap, channel_gaps, summarise
from tuning.residual import LogCost
from tuning.session import Session, open_session
from tuning.solver import Minimum, minimise

__all__ = [
    "STAGES",
    "ChannelGaps",
    "Fit",
    "Gap",
    "HeldOut",
    "LogCost",
    "Minimum",
    "Progress",
    "Session",
    "Stage",
    "block_width",
    "channel_gaps",
    "fit",
    "fold_of_lines",
    "minimise",
    "open_session",
    "predict",
    "predict_held_out",
    "random_starts",
    "summarise",
]
