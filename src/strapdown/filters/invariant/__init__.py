"""Filters on the group of extended poses: invariant and equivariant."""
