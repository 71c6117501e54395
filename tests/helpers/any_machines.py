"""Machines with what a plain station has not: weight, geoms, turned bodies, tendons, servos."""

from pathlib import Path

_GALLERY = Path(__file__).resolve().parents[2] / "assets" / "gallery"
GANTRY = (_GALLERY / "gantry.xml").read_text("utf-8")
SERVO_AXIS = (_GALLERY / "servo-axis.xml").read_text("utf-8")
