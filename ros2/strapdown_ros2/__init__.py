"""A node of ROS 2 that runs a filter of strapdown on what topics bring."""
