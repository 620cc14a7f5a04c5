"""Whether filters are as good as they say, at every grade and in every scenario."""
