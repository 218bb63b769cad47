"""From readings to stationary scans, station poses and the evidence grid."""
