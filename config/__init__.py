"""Schema, defaults and errors: what every other package may import."""
