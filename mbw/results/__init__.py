"""Results of verbs that other verbs read: their files and what they hold."""
