"""Checks of the measured channels and set-ups before they are used."""
