"""From the evidence grid to filled holes with a certainty, and to a surface."""
