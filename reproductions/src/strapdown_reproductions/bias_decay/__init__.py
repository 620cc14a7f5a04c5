"""Estimates of biases that decay against those that are held: `strapdown reproduce bias-decay`."""
