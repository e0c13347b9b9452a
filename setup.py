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
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = 'masmc_ros'
# Contact and URLs stand in package.xml alone, where they are set at a release.
MANIFEST = ElementTree.parse('package.xml').getroot()
MAINTAINER = MANIFEST.find('maintainer')
EMAIL = MAINTAINER.get('email')
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
    scripts += [f'{node} = masmc_ros.cli.main:{node}' for node in NODES]
    shims = [('bin', ['scripts/masmc'])]

setup(
    name=NAME,
    version='0.1.0',
    description='Robust adaptive sliding mode control of mobile manipulators for ROS 2',
    long_description=Path('README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author=MANIFEST.findtext('author'),
    maintainer=MAINTAINER.text,
    maintainer_email=None if EMAIL.endswith('.invalid') else EMAIL,
    url=MANIFEST.findtext("url[@type='repository']"),
    license='Apache-2.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'py.typed', '__init__.pyi', 'nodes/middleware/fast_dds/*', 'report/page/*',
            'compare/*.html', 'messages/*.json', 'native/templates/*',
        ],
    },
    python_requires='>=3.11',
    # ROS 2 packages are not named here: their distributions are called differently in the
    # wheels and in apt. The extra `ros` brings the wheels.
    install_requires=[
        'jinja2',
        'llvmlite',
        'lz4',
        'markupsafe',
        'matplotlib',
        'mcap',
        'mcap-ros2-support',
        f'numba>={NUMBA["OLDEST"]},<{NUMBA["FIRST_UNSUPPORTED"]}',
        'numpy>=1.26',
        'plotly>=6,<8',
        'PyYAML',
        'rosbags',
        'tqdm',
        'zstandard',
    ],
    # Versions outside of the tested ones may have another interface, or none: both ends are bound.
    extras_require={
        'ros': [
            f'ros-jazzy-rclpy[fastrtps]; {WHEELS}',
            f'ros-jazzy-common-interfaces; {WHEELS}',
        ],
        'completion': ['argcomplete'],
        'gpu': ['cuda-bindings>=12.8,<14'],
        'identify': ['clarabel>=0.11,<0.12', 'scipy'],
        'learning': ['gymnasium>=1.1,<2', 'scipy'],
        'mujoco': ['mujoco-core>=4.0,<4.1'],
        'parquet': ['pyarrow'],
        'paths': ['ruckig>=0.19,<0.20', 'scipy', 'toppra>=0.6.10,<0.7'],
        'play': ['trimesh>=4,<6', 'viser>=1.1,<1.2'],
        'campaigns': ['pyarrow', 'scipy'],
        'notebook': ['pandas', 'pyarrow', 'scipy', 'xarray'],
        'cluster': ['distributed', 'pyarrow', 'scipy'],
        'tune': ['optuna>=5,<6', 'scipy'],
        'test': [
            'argcomplete',
            'clarabel>=0.11,<0.12',
            'distributed',
            'gymnasium>=1.1,<2',
            'hypothesis',
            'mpmath',
            'mujoco-core>=4.0,<4.1',
            'optuna>=5,<6',
            'pandas',
            'pyarrow',
            'pytest',
            'pytest-xdist',
            'ruckig>=0.19,<0.20',
            'scipy',
            'sybil',
            'sympy',
            'toppra>=0.6.10,<0.7',
            'trimesh>=4,<6',
            'viser>=1.1,<1.2',
            'websockets',
            'xarray',
        ],
        # Robots and an oracle for the tests that take long: 1.3 GB.
        'robots': [
            'example-robot-data>=6,<7',
            'hello-robot-stretch-urdf>=0.1,<0.2',
            'pin>=4,<5',
        ],
        # Only for tests; Makefile installs it with the CPU build of PyTorch.
        'baselines': ['gymnasium>=1.1,<2', 'stable-baselines3>=2.9,<3'],
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
