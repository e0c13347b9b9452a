#!/bin/sh
# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

# Installs the wheels of rclpy into the environment, unless a ROS 2 Jazzy is sourced.
# usage: install_ros.sh PYTHON [CONSTRAINTS]
python=$1
constraints=${2:-constraints.txt}
if "$python" -c 'import rclpy, sensor_msgs, nav_msgs, std_srvs' >/dev/null 2>&1; then
    exit 0
fi
if [ -n "${AMENT_PREFIX_PATH:-}" ]; then
    echo "A ROS 2 installation is sourced, but $python cannot import rclpy from it." >&2
    echo "Use the Python that it was built for (Jazzy: 3.12), or run make in a shell without it." >&2
    exit 1
fi
if [ "$(uname -s)-$(uname -m)" != Linux-x86_64 ]; then
    echo "rclpy has wheels for Linux x86_64 only; this is $(uname -s) $(uname -m)." >&2
    echo "masmc simulate and masmc report work here; for the nodes source a ROS 2 Jazzy installation." >&2
    exit 0
fi
exec "$python" -m pip install --quiet --disable-pip-version-check -c "$constraints" \
    'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces
