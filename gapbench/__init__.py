"""GapBench: campaigns whose answers are known, and a grader of what an entry says of them.

An entry is any command that takes the folder of a campaign and prints an answer of ten lines of
JSON. The grader needs numpy alone and knows nothing of any diagnosis; ``draw`` and ``baselines``
need the extra ``[draw]``.
"""
