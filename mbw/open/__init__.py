"""``mbw open``: the workbench of a campaign, a model or a folder of results."""
