"""Checks of measured channels and set-ups before their FRFs are used."""
