"""A short drive by hand with other gains, measured beside the same drive with the robot's own."""
