"""The verdict against the truth: `strapdown reproduce verdicts`."""
