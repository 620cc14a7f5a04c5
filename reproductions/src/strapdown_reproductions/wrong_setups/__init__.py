"""Set-ups with a known mistake: how many of them `inspect` and the verdict find and name."""
