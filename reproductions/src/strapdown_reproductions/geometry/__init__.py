"""Filters on the group of extended poses beside the others: `strapdown reproduce geometry`."""
