# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The named signals of a tick: what passes between plant, controller, log and report.

Declared here once. A run is an array of such records, one a tick; a node has one.
"""

from __future__ import annotations

from masmc_ros.numerics.field import Field

SIGNALS = (
    Field('position', 'positions', 'Positions as measured', 'm, rad'),
    Field('velocity', 'positions', 'Velocities as measured', 'm/s, rad/s'),
    Field('true_position', 'positions', 'Positions as they are', 'm, rad'),
    Field('true_velocity', 'positions', 'Velocities as they are', 'm/s, rad/s'),
    Field('applied', 'joints', 'Torque held over the interval that ended at the tick', 'N·m'),
    Field('reference', 'desired', 'x_d, then xdot_d, then xddot_d of the task', 'm'),
    Field('raw_torque', 'joints', 'Torque that the law asked for, before limits', 'N·m'),
    Field('torque', 'joints', 'Torque commanded', 'N·m'),
    Field('rates', 'joints', 'Rates commanded in place of a torque', 'm/s, rad/s'),
    Field('error', 'axes', 'e = x - x_d', 'm'),
    Field('surface', 'axes', 's = edot + sigma e', 'm/s'),
    Field('estimate', 'parameters', 'theta_hat in the torque'),
    Field('singular', description='Whether the task is close to singular', kind='i8'),
)
"""Every signal, in the order of their making."""
