"""What GNSS receivers write, UBX and NMEA 0183, taken apart, and their clocks."""
