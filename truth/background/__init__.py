"""The background of small imperfections that every real machine has beside its one real fault."""
