"""The running program: acquisition, the mapping pipeline, publication."""
