"""A ROS 2 node that drives a robot through `wheelwire`: cmd_vel in, odometry out.

hardware_robot (the drivers) -> node (lifecycle) -> open_robot (while the robot is open)
cmd_vel -> commands -> connection (sessions, e-stop), speed_limiter -> driver
driver -> reader -> estimator -> publishers -> odom, /tf, joint_states; pose: across restarts
parameters, parameter_values, parameter_bridge: the node's parameters and the robot's
robot_state, diagnostics, services: ~/state, /diagnostics, ~/estop ...; threads: what runs where
"""
