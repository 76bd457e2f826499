"""Kinematics and odometry of a differential drive: arithmetic, without a robot or a clock.

`kinematics` turns a twist of the body into velocities of the wheels and back, within the limit.
`odometry` adds up the ticks of wheel samples to a pose, also across a reset of the device.
`covariance` says how uncertain that pose is (it alone needs numpy).
Data flow: samples -> `Odometry` -> `OdometryUpdate` -> `PoseCovariance`.
"""
