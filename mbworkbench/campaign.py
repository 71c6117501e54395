"""A measured campaign, opened from its folder."""

from dataclasses import dataclass
from pathlib import Path

from identification import correct_layout, read_layout, read_settings
from identification import read_campaign as read_tests
from identification.words import Campaign, shorten_names
from mbmodel import load_machine
from mbworkbench.labels import AnyPath, as_path
from mbworkbench.tables import Shown, Table


@dataclass(frozen=True, eq=False)
class MeasuredCampaign(Shown):
    """The hammer tests of one machine, as a campaign folder holds them.

    Attributes:
        source: path of its ``campaign.toml``.
        content: layout, tests with their FRFs, tolerances and remarks; all frequency lines.
    """

    source: Path
    content: Campaign

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.content.name

    @property
    def outputs(self) -> tuple[str, ...]:
        """Labels of the measured channels."""
        return tuple(str(dof) for dof in self.content.outputs)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Labels of the points and directions that were hit."""
        return tuple(str(dof) for dof in self.content.inputs)

    def __repr__(self) -> str:
        """Return a summary of at most ten lines."""
        freq, content = self.content.freq_hz, self.content
        return "\n".join(
            (
                f"campaign {self.name}: {len(content.tests)} tests, {len(self.outputs)} channels, "
                f"{len(freq)} lines {freq[0]:g}..{freq[-1]:g} Hz, "
                f"{content.tests[0].estimate.frf.quantity}",
                f"  hit at {shorten_names(self.inputs)}",
                *(f"  {remark}" for remark in content.remarks[:5]),
            )
        )

    def table(self) -> Table:
        """Return a table of the tests."""
        rows = [
            (
                test.condition.test,
                test.condition.reference,
                test.condition.level_n,
                test.estimate.averages,
                len(test.estimate.frf.outputs),
                test.estimate.variance_source,
            )
            for test in self.content.tests
        ]
        header = ("file", "hit at", "level [N]", "averages", "channels", "variance from")
        return Table(repr(self).splitlines()[0], header, rows)


def read_campaign(path: AnyPath) -> MeasuredCampaign:
    """Read a campaign folder: ``campaign.toml``, the model or layout named there, and the tests.

    Args:
        path: the folder, or its ``campaign.toml``.

    Raises:
        InputError: a file that cannot be used; the sentence names file, element and remedy.
    """
    source, settings = read_settings(as_path(path))
    if settings.layout is not None:
        layout = read_layout(source.parent / settings.layout)
    else:
        layout = load_machine(source.parent / str(settings.model), key=settings.key).layout
    layout = correct_layout(source, settings, layout)
    return MeasuredCampaign(source, read_tests(source, settings, layout))
