"""Kinematics and odometry of a differential drive."""
