"""Proposals for the next test."""
