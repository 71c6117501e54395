"""``mbw diagnose``: what the model lacks, its files and page."""
