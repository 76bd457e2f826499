#!/bin/bash
# What runs here finds ROS and the node.
set -e
source /opt/ros/jazzy/setup.bash
source /opt/wheelwire_ros/install/setup.bash
exec "$@"
