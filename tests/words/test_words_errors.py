"""Messages of errors: texts of the user in them are printable and short."""

import pickle
import time

import numpy as np
import pytest

from identification.words import InputError, UsageError


def test_a_quoted_text_is_cut_and_the_remedy_stays():
    binary = np.random.default_rng(39_010).bytes(120_000)
    for quoted in (repr(binary), repr(binary.decode("latin-1")), f"'{'a' * 120_000}'"):
        text = str(InputError(f"campaign.toml: level = {quoted}: give a number"))
        assert len(text) < 200
        assert text.startswith("campaign.toml: level = ")
        assert text.endswith(": give a number")


def test_a_short_message_stays_as_it_is():
    text = "model.xml: body 'a' has the name of a site's body 'b', and \"c\": rename one's name"
    assert str(InputError(text)) == text


def test_what_cannot_be_printed_is_written_as_an_escape():
    text = str(UsageError("a\0b \x1b[31m \udc80 é"))
    assert text == "a\\x00b \\x1b[31m \\udc80 é"


@pytest.mark.parametrize("text", ["'" * 300_000, '"' + "'\\" * 200_000, "a" * 300_000])
def test_any_message_is_bounded_and_quick(text):
    begin = time.monotonic()
    message = str(InputError(f"start {text} end"))
    assert len(message) < 1100
    assert message.startswith("start ")
    assert message.endswith(" end")
    assert time.monotonic() - begin < 5


def test_an_error_survives_the_way_between_processes():
    error = InputError("a\0" + "'" + "b" * 200 + "'")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
