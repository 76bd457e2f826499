"""Each driver's rig: encoders that turn at a given rate, and an eye on the bridge's EN."""
