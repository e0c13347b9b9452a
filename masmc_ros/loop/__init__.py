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
The sampled closed loop: control tick, plant tick and the run made of them.

Ticks k = 0 ... N, t_k = k T. At tick k the state is taken as exact, the torque is held until
tick k + 1. The same compiled code serves the nodes, one tick at a time, and the simulation
of a whole run.
"""
