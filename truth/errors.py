"""The exceptions of the virtual machine: an input that cannot be used."""


class TruthError(Exception):
    """A model, a name or a folder cannot be used; the message says what to do instead."""


class NoPlaceError(TruthError):
    """A machine has no place for an effect, or not the one that was named."""
