"""Tuning of a model to a campaign: parametrisation, misfit, fits, gaps and held-out predictions."""

from identification.words import TOLERANCE_BOUND_SIGMA
from tuning.assessment.further_tests import mean_channel_variance, predict_tests
from tuning.assessment.gap import (
    MIN_VISIBLE_EXCESS,
    ChannelGaps,
    Gap,
    channel_gaps,
    gap_at_bodies,
    is_gap_visible,
    summarise_gaps,
)
from tuning.assessment.held_out import HeldOutFits, fit_held_out, hold_out_lines
from tuning.assessment.parameter_confidence import (
    NORMAL_QUANTILE_95,
    ParameterConfidence,
    estimate_confidence,
)
from tuning.assessment.parameter_posterior import ParameterPosterior, PosteriorOfModel
from tuning.campaign_tuning import (
    CampaignTuning,
    FrfPlace,
    ProgressCallbacks,
    ResidualKind,
    select_stages,
    tune,
)
from tuning.files.input_files import fingerprint
from tuning.files.posterior_file import POSTERIOR_NPZ, read_posterior
from tuning.files.result import (
    LevelFrfs,
    TuningResult,
    read_result,
    write_atomically,
    write_result,
)
from tuning.files.schema import TunedFile
from tuning.fitting.checkpoint import CHECKPOINT_FILE, Checkpoint
from tuning.fitting.error_floor_fit import FloorSchedule, fit_at_error_floor
from tuning.fitting.fitter import Fit, FitProgress, fit
from tuning.fitting.machine_fit import random_starts
from tuning.fitting.stage_search import GAUSS_NEWTON, STAGES, Stage, thin_lines, thinning_slice
from tuning.misfit.batch import predict
from tuning.misfit.misfit import Misfit
from tuning.misfit.modal_misfit import modes_in_band, select_modes
from tuning.misfit.residual_statistics import (
    estimate_model_error,
    residual_statistics,
)
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.parametrisation.user_specification import UserSpecification, parametrise
from tuning.session import (
    Session,
    change_machine,
    find_wrong_exports,
    open_campaign,
    open_session,
)
from tuning.solvers.nlopt_solver import TUNING_ALGORITHM, Minimum
from tuning.toleranced_model import build_toleranced_model, rebuild_for_machine

__all__ = [
    "CHECKPOINT_FILE",
    "GAUSS_NEWTON",
    "MIN_VISIBLE_EXCESS",
    "NORMAL_QUANTILE_95",
    "POSTERIOR_NPZ",
    "STAGES",
    "TOLERANCE_BOUND_SIGMA",
    "TUNING_ALGORITHM",
    "CampaignTuning",
    "ChannelGaps",
    "Checkpoint",
    "Fit",
    "FitProgress",
    "FloorSchedule",
    "FrfPlace",
    "Gap",
    "HeldOutFits",
    "LevelFrfs",
    "Minimum",
    "Misfit",
    "ParameterConfidence",
    "ParameterPosterior",
    "Parametrisation",
    "PosteriorOfModel",
    "ProgressCallbacks",
    "ResidualKind",
    "Session",
    "Stage",
    "TunedFile",
    "TuningResult",
    "UserSpecification",
    "build_toleranced_model",
    "change_machine",
    "channel_gaps",
    "estimate_confidence",
    "estimate_model_error",
    "find_wrong_exports",
    "fingerprint",
    "fit",
    "fit_at_error_floor",
    "fit_held_out",
    "gap_at_bodies",
    "hold_out_lines",
    "is_gap_visible",
    "mean_channel_variance",
    "modes_in_band",
    "open_campaign",
    "open_session",
    "parametrise",
    "predict",
    "predict_tests",
    "random_starts",
    "read_posterior",
    "read_result",
    "rebuild_for_machine",
    "residual_statistics",
    "select_modes",
    "select_stages",
    "summarise_gaps",
    "thin_lines",
    "thinning_slice",
    "tune",
    "write_atomically",
    "write_result",
]
