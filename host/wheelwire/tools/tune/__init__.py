"""A short drive by hand with other gains, compared with the same drive with the robot's own."""
