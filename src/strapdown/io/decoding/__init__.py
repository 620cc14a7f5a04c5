"""What several readers share: pieces of formats, and the structure of those that need more than one
file."""
