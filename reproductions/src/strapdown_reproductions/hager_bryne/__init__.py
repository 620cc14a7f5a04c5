"""Hager & Bryne: open against closed loop."""
