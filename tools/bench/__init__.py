"""Benches: the figures that the README states, each measured by one command."""
