"""Workers of independent calls: processes, a cluster, or an executor of the user."""
