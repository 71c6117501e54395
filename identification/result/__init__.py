"""Result of an identification: the record, its files, and the sentences on its limits."""
