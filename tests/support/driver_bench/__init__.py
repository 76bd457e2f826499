"""A rig for each driver: turns encoders at a given rate and watches the bridge's EN."""
