# SPDX-License-Identifier: Apache-2.0
# ROS 2 Jazzy with masmc_ros in the workspace /ws:
#   docker build -t masmc_ros .
#   docker run --rm masmc_ros masmc simulate paper --set duration=5.0
FROM ros:jazzy

SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /ws

# Dependencies are a layer of their own: they change rarely.
COPY package.xml src/masmc_ros/package.xml
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3-pip \
    && rosdep update --rosdistro jazzy \
    && PIP_BREAK_SYSTEM_PACKAGES=1 rosdep install --from-paths src --ignore-src --rosdistro jazzy -y \
    && rm -rf /var/lib/apt/lists/*
COPY constraints.txt src/masmc_ros/constraints.txt
# The version is that of constraints.txt.
# hadolint ignore=DL3013
RUN plotly=$(grep '^plotly==' src/masmc_ros/constraints.txt) \
    && python3 -m pip install --no-cache-dir --break-system-packages "$plotly"

COPY . src/masmc_ros
# The shell of an interactive session and the command of `docker run` both have the workspace.
RUN source /opt/ros/jazzy/setup.bash \
    && colcon build \
    && printf '#!/bin/bash\nset -e\nsource /ws/install/setup.bash\nexec "$@"\n' >/entrypoint.sh \
    && chmod +x /entrypoint.sh \
    && echo 'source /ws/install/setup.bash' >>/root/.bashrc

ENTRYPOINT ["/entrypoint.sh"]
CMD ["bash"]
