"""``mbw live``: beside a hammer test, each hit judged as it comes."""
