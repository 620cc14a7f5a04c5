"""An aircraft flown by an autopilot on the estimates of a filter."""
