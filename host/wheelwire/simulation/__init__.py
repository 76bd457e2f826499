"""A robot without hardware: the firmware with a plant behind it, and a bad line before it."""
