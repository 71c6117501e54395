"""``mbw diagnose``: search for effects that the model lacks, the files and page of the verdict."""
