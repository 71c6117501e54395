"""``mbw report``: writing of a result's page."""
