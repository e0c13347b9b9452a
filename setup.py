# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
One package for two installers: colcon on a ROS machine, pip anywhere else.

Metadata stand here and not in pyproject.toml, because `colcon build --symlink-install` does
not take them from there.
"""

from glob import glob
from pathlib import Path
from runpy import run_path
import sys

from setuptools import find_packages, setup

NAME = 'masmc_ros'
NUMBA = run_path(f'{NAME}/jit/supported_numba.py')
NODES = sorted(Path(file).parent.name for file in glob(f'{NAME}/nodes/*/node.py'))
WHEELS = "platform_system == 'Linux' and platform_machine == 'x86_64'"

# `ros2 run` looks for executables in lib/masmc_ros. colcon puts console scripts there by
# setup.cfg, and puts bin/ on the PATH: there goes a script that calls `masmc`. pip puts them in
# bin/, where names such as `plant` would be in everybody's way: a wheel has `masmc` there, and
# shims that call it where `ros2 run` looks. A wheel takes its entry points from `dist_info`,
# which runs first and on its own.
is_wheel = not {'dist_info', 'bdist_wheel', 'editable_wheel'}.isdisjoint(sys.argv)
scripts = ['masmc = masmc_ros.cli.main:main']
shims = []
if is_wheel:
    shims = [(f'lib/{NAME}', sorted(glob('shims/*')))]
else:
    scripts += [f'{node} = masmc_ros.cli.executables:{node}' for node in NODES]
    shims = [('bin', ['scripts/masmc'])]

setup(
    name=NAME,
    version='0.1.0',
    description='Robust adaptive sliding mode control of mobile manipulators for ROS 2',
    author='masmc_ros developers',
    author_email='maintainers@masmc-ros.org',
    maintainer='masmc_ros developers',
    maintainer_email='maintainers@masmc-ros.org',
    url='https://github.com/masmc-ros/masmc_ros',
    license='Apache-2.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'py.typed', '__init__.pyi', 'nodes/middleware/fast_dds/*', 'report/page/*',
            'compare/*.html', 'messages/*.json',
        ],
    },
    python_requires='>=3.11',
    # ROS 2 packages are not named here: their distributions are called differently in the
    # wheels and in apt. The extra `ros` brings the wheels.
    install_requires=[
        'jinja2',
        'lz4',
        'markupsafe',
        'matplotlib',
        'mcap',
        'mcap-ros2-support',
        f'numba>={NUMBA["OLDEST"]},<{NUMBA["FIRST_UNSUPPORTED"]}',
        'numpy>=1.26',
        'plotly>=6',
        'PyYAML',
        'rosbags',
        'tqdm',
        'zstandard',
    ],
    extras_require={
        'ros': [
            f'ros-jazzy-rclpy[fastrtps]; {WHEELS}',
            f'ros-jazzy-common-interfaces; {WHEELS}',
        ],
        'identify': ['clarabel>=0.11', 'scipy'],
        'learning': ['gymnasium>=1.1', 'scipy'],
        'live': ['foxglove-sdk'],
        'mujoco': ['mujoco-core>=4'],
        'parquet': ['pyarrow'],
        'campaigns': ['pyarrow', 'scipy'],
        'notebook': ['pyarrow', 'scipy', 'xarray'],
        'cluster': ['distributed', 'pyarrow', 'scipy'],
        'tune': ['optuna', 'scipy'],
        'test': [
            'clarabel>=0.11',
            'distributed',
            'foxglove-sdk',
            'gymnasium>=1.1',
            'hypothesis',
            'mpmath',
            'mujoco-core>=4',
            'optuna',
            'pyarrow',
            'pytest',
            'pytest-xdist',
            'scipy',
            'sybil',
            'sympy',
            'websockets',
            'xarray',
        ],
        # Robots and an oracle for the tests that take long: 1.3 GB.
        'robots': ['example-robot-data>=6', 'hello-robot-stretch-urdf', 'pin>=4'],
        # `make docs` installs these alone: the Python API is read from the sources.
        'docs': [
            'furo',
            'myst-nb',
            'sphinx',
            'sphinx-autoapi',
            'sphinx-copybutton',
            'sphinxcontrib-katex',
        ],
        'lint': ['mypy', 'ruff', 'types-PyYAML', 'types-tqdm'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', sorted(glob('config/*'))),
        (f'share/{NAME}/launch', sorted(glob('launch/*.launch.py'))),
        *shims,
    ],
    entry_points={'console_scripts': scripts},
    zip_safe=False,
)
