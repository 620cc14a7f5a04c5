"""Bags of ROS and MCAP files: containers, messages and what of a recording they are."""
