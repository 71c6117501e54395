"""The architecture's tables name every folder of every package."""

import pytest

from mbw.command import VERBS
from tests.docs.results import ROOT
from tests.test_imports import PACKAGES

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
OF_VERBS = {verb.options.split(".")[1] for verb in VERBS.values()}  # one row for all


@pytest.mark.parametrize("package", PACKAGES)
def test_every_room_is_in_a_table(package):
    folders = [path.parent for path in sorted((ROOT / package).rglob("*/__init__.py"))]
    rooms = [path.relative_to(ROOT / package).as_posix() for path in folders]
    verbs = OF_VERBS if package == "mbw" else set()
    assert [room for room in rooms if f"`{room}/`" not in PAGE and room not in verbs] == []
