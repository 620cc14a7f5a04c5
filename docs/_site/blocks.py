def stale():
    return []
