"""Checks of the measurement against the nominal model, before any fit."""
