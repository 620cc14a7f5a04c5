"""Consistency of the filters at every grade and in every scenario."""
