"""Readers of campaigns, FRFs, time records, mode shapes and layouts."""
