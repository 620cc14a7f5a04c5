"""A scenario file of half a minute, for commands that simulate."""

SCENARIO = """name = "hop"
imu = "tactical"
rate_hz = 20
duration_s = 30

[motion]
kind = "straight"
start = { latitude_deg = 48, longitude_deg = 11, height_m = 600 }
azimuth_deg = 30
speed_m_s = 40

[gnss]
interval_s = 1
position_std_m = [1, 1, 1.5]
"""
