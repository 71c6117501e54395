"""Fixtures of the station, and of machines from text."""

from machine_fixtures import away, from_text, station, station_model

__all__ = ["away", "from_text", "station", "station_model"]
