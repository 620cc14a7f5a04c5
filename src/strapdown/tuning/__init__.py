"""The noise of a recording, told by itself: `tune`."""
