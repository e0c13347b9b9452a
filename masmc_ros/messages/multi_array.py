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

"""The layout of std_msgs/Float64MultiArray, which carries torques, references, telemetry."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.messages.layout import Layout


class MultiArrayLayout(Layout):
    """
    A Float64MultiArray with labelled dimensions.

    Attributes
    ----------
    labels
        where the characters of each label start, in bytes.
    offset
        where the message says how many numbers come before the array, in bytes.
    data
        where the numbers start, in bytes.
    count
        how many numbers there are.

    """

    def __init__(self, dimensions: Sequence[tuple[str, int]], data_offset: int) -> None:
        """
        Lay out a message.

        Parameters
        ----------
        dimensions
            label and size of each, the slowest first.
        data_offset
            how many numbers come before the array.

        """
        super().__init__()
        strides = [1]
        for _, size in reversed(dimensions):
            strides.insert(0, size * strides[0])
        self.count = data_offset + strides[0]
        self.labels: list[int] = []
        self.uint32(len(dimensions))
        for (label, size), stride in zip(dimensions, strides, strict=False):
            self.labels.append(self.string(label))
            self.uint32(size)
            self.uint32(stride)
        self.offset = self.uint32(data_offset)
        self.data = self.sequence(self.count)
