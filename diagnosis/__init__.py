"""What the model lacks: so far, where the gap that remains after tuning shows most."""

from diagnosis.residual import ResidualShare, residual_shares

__all__ = ["ResidualShare", "residual_shares"]
