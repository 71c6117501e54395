"""The error budget in Python, with controllers of python-control."""

import control
import numpy as np
import pytest
from budget_case import BUDGET, write_machine

import mbworkbench as mb


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("face")
    write_machine(place)
    text = BUDGET.format(gain=3e5, delay=0.0, lines="")
    (place / "budget.toml").write_text(text, encoding="utf-8")
    return place


def test_a_controller_of_python_control_replaces_that_of_the_file(folder):
    model = mb.read_model(folder / "two.xml")
    stated = mb.error_budget(model, folder / "budget.toml")
    system = control.zpk([-60.0, -8.0], [-0.5, -700.0], 3e5)
    given = mb.error_budget(
        folder / "two.xml", folder / "budget.toml", controllers={"axis": system}
    )
    assert given.rms == pytest.approx(stated.rms, rel=1e-9)
    open_loop = mb.error_budget(model, folder / "budget.toml", controllers={"axis": 0.0})
    assert open_loop.rms["top"] > 1.2 * stated.rms["top"]
    assert open_loop.interval == {}
    assert repr(stated).startswith("top: ")
    assert "largest source" in stated._repr_html_()
    figure = mb.plot(stated)
    assert np.max(figure.data[0].y) == pytest.approx(1e9 * stated.rms["top"])


def test_a_controller_of_no_loop_is_refused(folder):
    model = mb.read_model(folder / "two.xml")
    with pytest.raises(mb.UsageError, match="has no loop 'ty'"):
        mb.error_budget(model, folder / "budget.toml", controllers={"ty": 1.0})


def test_a_controller_with_an_unstable_pole_that_its_zero_cancels_is_refused(folder):
    hidden = control.tf(np.polymul([3e5], [1, -5.0]), np.polymul([1, 700.0], [1, -5.0]))
    with pytest.raises(mb.InputError, match=r"closed loop is unstable: the pole 5 "):
        mb.error_budget(folder / "two.xml", folder / "budget.toml", controllers={"axis": hidden})
