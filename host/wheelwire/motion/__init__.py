"""What wheels do to a body: kinematics and odometry."""
