"""``mbw simulate``: a virtual hammer test as a campaign, or the response to a signal."""
