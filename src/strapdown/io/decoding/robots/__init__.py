"""Bags of ROS and MCAP files: containers, messages and their use in a recording."""
