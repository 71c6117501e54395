"""Difference of a file or column from the nominal model as a whole: its reasons, in a sentence."""

from collections.abc import Iterable
from dataclasses import dataclass

from identification.words import group_by_key
from tuning.checks.export_faults import ExportFault

_MAX_REASONS = 2  # that a sentence names
_MAX_PAIRS = 2  # of encoder and motor in a file that have a sentence each
_UNKNOWN_GAIN = 'gain = "unknown" of the motor or encoder that is in amperes, counts or volts'


@dataclass(frozen=True)
class ExportFinding:
    """Difference of one file or column from the nominal model as a whole.

    Args:
        file: name of the file, as campaign.toml gives it.
        factor: measured over nominal FRFs, in the median, with the shift that suits the best fault.
        faults: most likely faults, best first; empty where none explains the difference.
        is_certain: whether the file cannot be right as it was read.
        columns: clause on encoder and motor; empty without.
        table: where campaign.toml states their unit.
    """

    file: str
    factor: float
    faults: tuple[ExportFault, ...]
    is_certain: bool
    columns: str = ""
    table: str = "in its [[test]]"

    @property
    def is_level(self) -> bool:
        """Whether the faults that are named are factors of the FRFs alone."""
        named = self.faults[:_MAX_REASONS]
        return all(f.axis == 1.0 and f.order == 0 and not f.is_elsewhere for f in named)

    @property
    def sentence(self) -> str:
        """Sentence with the fault, its reason, and the key that corrects it."""
        where = f"{self.file}{self.columns}"
        named = self.faults[:_MAX_REASONS]
        if not named and self.columns:
            return (
                f"{where}: measured FRFs are {_times(self.factor)} the nominal model's in the "
                f"median over the band: state their unit {self.table}, or {_UNKNOWN_GAIN}"
            )
        if not named:
            return (
                f"{where}: measured FRFs are {_times(self.factor)} the nominal model's in the "
                "median over the band: check unit and quantity in [[test]], the gain of the force "
                "channel, and the masses of the model"
            )
        reasons = ", or ".join(fault.reason for fault in named)
        keys = ", or ".join(dict.fromkeys(f.remedy for f in named if not f.is_elsewhere))
        actions = [f"set {keys} {self.table}"] if keys else []
        actions += dict.fromkeys(fault.remedy for fault in named if fault.is_elsewhere)
        is_level = self.is_level
        gain = f", or {_UNKNOWN_GAIN}" if self.columns else ""
        masses = f"{gain}, or correct the masses of the model" if is_level else ""
        level = f"are {_times(self.factor)} the nominal model's" if is_level else "fit the model"
        likely = "" if self.is_certain else " rather"
        return (
            f"{where}: measured FRFs {level}{likely}, as if {reasons}: "
            f"{', or '.join(actions)}{masses}"
        )


def describe_wrong_exports(findings: Iterable[ExportFinding]) -> list[str]:
    """Return a sentence on each finding; pairs of encoder and motor share one if they are many."""
    sentences = []
    for file, of_file in group_by_key((finding.file, finding) for finding in findings).items():
        if len(of_file) <= _MAX_PAIRS:
            sentences += [finding.sentence for finding in of_file]
            continue
        by_factor = sorted(of_file, key=lambda finding: finding.factor)
        low, high = by_factor[0], by_factor[-1]
        sentences.append(
            f"{file}: {len(of_file)} pairs of encoder and motor have FRFs from {_times(low.factor)}"
            f" to {_times(high.factor)} the nominal model's in the median over the band (the last"
            f"{high.columns}). A wrong unit is in all FRFs of its encoder or motor: state it "
            f"{high.table}, or {_UNKNOWN_GAIN}; else the model is far from the machine"
        )
    return sentences


def _times(factor: float) -> str:
    """Return a factor as text."""
    return f"{factor:.2g} times" if factor >= 1 else f"1/{1 / factor:.2g} of"
