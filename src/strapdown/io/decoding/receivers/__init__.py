"""Decoders of UBX and NMEA 0183, as GNSS receivers write them, and the receivers' clocks."""
