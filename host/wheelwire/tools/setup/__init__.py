"""A robot's first hour: its board, IMU, wiring, counts, motors and gains, found by measuring.

`setup` leads through all of it: it asks by `questions`, and tries values as parameters on trial.
`imu` has the robot lifted and turned by hand, `imu_mounting` deduces how it is mounted.
`wiring` examines supply, contact and wheels, `counts` the encoders; `problems` names each defect.
`identification` measures the motors by duty alone, `fits` models that, `gains` follow from it.
`before_after` compares a test drive before and after. All of them move the robot through `driving`.
Data flow: driver -> samples (`driving`) -> findings -> parameters -> the robot, after a yes.
"""
