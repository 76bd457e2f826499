"""A ROS 2 node that drives a robot through `wheelwire`: cmd_vel in, odometry out.

node.py         the lifecycle node; open_robot.py: what exists while its robot is open; drivers.py
commands.py     cmd_vel and its age; robot_connection.py: how it reaches the robot; speed_limiter.py
reader.py       the thread that reads samples; motion_estimator.py: odometry of them; publishers.py
sensors.py      topics of IMU, ranges, bumpers and battery; gyro_bias.py
robot_state.py  ~/state; diagnostics.py; services.py; pose_memory.py: the pose across restarts
parameters.py   what they are; parameter_bridge.py: keeps the node's and the robot's consistent
"""
