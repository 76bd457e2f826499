"""The link to a robot: session, port, threads."""
