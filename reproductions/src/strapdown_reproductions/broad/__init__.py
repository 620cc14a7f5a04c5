"""BROAD: attitude filters on recorded trials."""
