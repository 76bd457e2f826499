"""A ROS 2 node that drives a robot through `wheelwire`: cmd_vel in, odometry out."""
