"""Foreign recordings, read as bytes with a time and the name of their line."""
