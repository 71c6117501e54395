"""The diagnosis of a campaign: what the model lacks."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from diagnosis import Diagnosis, Verdict, build_verdict, hash_inputs
from diagnosis import diagnose as diagnose_session
from diagnosis.settings import DiagnosisSettings
from diagnosis.verdict.sentences import verdict_sentence
from identification.words import UsageError
from mbworkbench.campaign import MeasuredCampaign, open_checkpoint, open_together, takes_a_campaign
from mbworkbench.labels import AnyPath, as_path, check_count
from mbworkbench.model import MachineModel
from mbworkbench.tables import Shown, Table, cell_text
from mbworkbench.tuning import TunedModel


@dataclass(frozen=True, eq=False)
class DiagnosisResult(Shown):
    """The verdict on a campaign, with everything that led to it.

    Attributes:
        campaign: name of the campaign.
        verdict: the content of ``verdict.json``.
        fits: scores, refits and evidence that led to it.
    """

    campaign: str
    verdict: Verdict
    fits: Diagnosis

    @property
    def sentence(self) -> str:
        """Sentence of the verdict: the missing effect, its place, and the fall of the gap."""
        return verdict_sentence(self.verdict)

    def write(self, file: AnyPath) -> Path:
        """Write the verdict as JSON.

        Args:
            file: path of the file.

        Raises:
            OSError: the file cannot be written.
        """
        target = as_path(file)
        target.write_text(self.verdict.model_dump_json(indent=1) + "\n", encoding="utf-8")
        return target

    def __repr__(self) -> str:
        """Return verdict, gap, most probable causes and rest in at most ten lines."""
        verdict, gap = self.verdict, self.verdict.gap
        rest = [verdict.rest] if verdict.rest and verdict.rest.significant else []
        steps = {"nominal": gap.as_drawn, "re-tuned": gap.retuned, "with the cause": gap.after}
        return "\n".join(
            (
                f"{self.campaign}: {verdict.verdict}. {self.sentence}",
                *(
                    f"  {name}: error {cell_text(step.error)}, excess {cell_text(step.excess)}"
                    for name, step in steps.items()
                    if step.excess is not None
                ),
                *(
                    f"  {100 * cause.probability:.0f} % {cause.effect} at {cause.location} "
                    f"{cause.dof or ''}".rstrip()
                    for cause in verdict.causes[:3]
                ),
                *(
                    f"  rest: excess {cell_text(row.excess)}, model error "
                    f"{100 * row.model_error:.2g} %, {row.spread}"
                    for row in rest
                ),
            )
        )

    def table(self) -> Table:
        """Return the causes with their probabilities and parameters."""
        header = ("effect", "location", "direction", "probability", "parameters")
        rows = [
            (
                cause.effect,
                cause.location,
                cause.dof,
                cause.probability,
                ", ".join(
                    f"{name} {_value_text(value)}" for name, value in cause.parameters.items()
                ),
            )
            for cause in self.verdict.causes
        ]
        return Table(f"{self.campaign}: {self.sentence}", header, rows)


@takes_a_campaign
def diagnose(
    campaign: MeasuredCampaign | TunedModel | AnyPath,
    *,
    model: MachineModel | None = None,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
    settings: DiagnosisSettings | None = None,
    progress: Callable[[str], None] | None = None,
    resume: AnyPath | None = None,
) -> DiagnosisResult:
    """Find what the model lacks, where, and how far the gap shrinks once it is added.

    Args:
        campaign: from ``read_campaign``, what ``tune`` returned, or the path of a folder.
        model: the nominal model; the one that ``campaign.toml`` names if None.
        band: lowest and highest frequency [Hz]; the lines with coherence, or those of the tuning,
            if None.
        jobs: number of processes; the verdict does not depend on it.
        settings: thresholds and sizes of the search; the usual ones if None.
        progress: called with the current step, in words.
        resume: file that keeps finished refits; an interrupted diagnosis goes on from it.

    Raises:
        InputError: campaign or model cannot be used, or the file is that of another diagnosis.
        UsageError: arguments are exchanged or out of their range, the band holds too few lines, or
            a tuning is given with another model or band.
    """
    check_count("jobs", jobs)
    settings = settings or DiagnosisSettings()
    if isinstance(campaign, TunedModel):
        if model is not None or band is not None:
            raise UsageError("a tuning has its model and band: call diagnose(tuning) without them")
        session = campaign.fits.session
    else:
        session = open_together(campaign, model, band)
    fits = diagnose_session(
        session,
        jobs=jobs,
        tell=progress,
        settings=settings,
        checkpoint=open_checkpoint(resume, lambda: hash_inputs(session, settings)),
    )
    return DiagnosisResult(session.campaign.name, build_verdict(fits), fits)


def _value_text(value: object) -> str:
    if isinstance(value, list | tuple):
        return "(" + ", ".join(cell_text(part) for part in value) + ")"
    return cell_text(value)
