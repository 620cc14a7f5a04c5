"""From the first seconds of a recording to a filter's start."""
