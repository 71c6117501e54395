"""The command and the report; computes nothing itself."""
