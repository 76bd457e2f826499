"""One robot, several programs: the one that holds its port offers it, others read and stop it."""
