"""An emulated vehicle with its sonar, compass and depth sensor in an emulated site."""
