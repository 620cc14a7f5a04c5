"""Initial alignment: the first seconds of a recording give a filter's initial state."""
