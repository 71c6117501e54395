"""Fits in stages from several starts, and their checkpoints.

A ``campaign`` here holds the tests on the lines that count.
"""
