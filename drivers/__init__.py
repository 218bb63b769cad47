"""From bytes with a time to readings, and the log that keeps both."""
