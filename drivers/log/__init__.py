"""Logs: MCAP files that hold every byte received or sent."""
