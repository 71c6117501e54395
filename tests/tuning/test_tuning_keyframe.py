"""The keyframe that campaign.toml states is that of the machine."""

import numpy as np
import pytest
from campaign_folder import write_folder

from identification.words import InputError
from tuning.session import open_campaign


@pytest.fixture
def keyed(tmp_path):
    """A campaign whose model has two keyframes, in which the base stands elsewhere."""
    folder = write_folder(tmp_path)
    path = folder / "model.xml"
    text = path.read_text(encoding="utf-8")
    keys = "".join(
        f'<key name="{name}" ctrl="{force}"/>' for name, force in (("home", 3e5), ("far", -3e5))
    )
    push = '<actuator><motor name="push" joint="base_tx"/></actuator>'
    text = text.replace("</mujoco>", f"{push}<keyframe>{keys}</keyframe></mujoco>")
    path.write_text(text, encoding="utf-8")
    return folder


def state(folder, key):
    path = folder / "campaign.toml"
    path.write_text(f'key = "{key}"\n' + path.read_text(encoding="utf-8"), encoding="utf-8")


@pytest.mark.parametrize(("key", "place"), [(None, 0.01), ("far", -0.01), ("", 0.0)])
def test_the_stated_keyframe_gives_the_pose_and_is_remarked(keyed, key, place):
    if key is not None:
        state(keyed, key)
    _, machine, campaign = open_campaign(keyed)
    # 3e5 N on 3e7 N/m move the base by 10 mm.
    np.testing.assert_allclose(machine.layout.centres[0, 0] - 0.02, place, atol=1e-9)
    assert any(text.startswith("model.xml: ") and "keyframe" in text for text in campaign.remarks)


def test_a_keyframe_that_the_model_lacks_is_refused(keyed):
    state(keyed, "near")
    with pytest.raises(InputError, match=r"model\.xml has no keyframe 'near'"):
        open_campaign(keyed)
